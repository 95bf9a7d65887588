// brume verify: a cache's answers against traced paths, and records against many gathers.
#include "cli/cache_input.h"
#include "cli/cache_session.h"
#include "cli/commands.h"
#include "cli/environment.h"
#include "cli/outputs.h"
#include "cli/shared_options.h"
#include "cli/text_table.h"
#include "cli/values.h"
#include "core/error.h"
#include "core/staged_file.h"
#include "study/record_errors.h"
#include "study/verify.h"

namespace brume {
namespace {

struct VerifyCommandOptions {
  SceneOptions scene;
  std::filesystem::path cache_file;
  std::optional<int> points;
  std::optional<int> paths;
  std::optional<std::uint64_t> seed;
  std::optional<double> max_rmse;
  std::optional<int> worst_points;
  std::optional<int> records;
  bool is_saved = false;
};

std::filesystem::path saved_result(const std::filesystem::path& cache_file) {
  return cache_file.string() + ".verify.json";
}

Json point_json(const VerifyPoint& point) {
  return {{"position", json_of(point.position)},
          {"normal", json_of(point.normal)},
          {"cached", point.cached},
          {"reference", point.reference},
          {"reference_error", point.reference_error},
          {"relative_error", point.relative_error()}};
}

// All but the time it took: the same cache, scene and options give the same text.
Json verification_json(const Verification& v) {
  Json all = Json::object();
  all["points"] = v.points;
  all["uncovered"] = v.uncovered;
  all["bias"] = v.bias;
  all["rmse"] = v.rmse;
  all["p95"] = v.p95;
  all["worst"] = v.worst.empty() ? Json() : point_json(v.worst.front());
  all["worst_points"] = Json::array();
  for (const VerifyPoint& point : v.worst) all["worst_points"].push_back(point_json(point));
  return all;
}

void print_verification(std::ostream& out, const Verification& v) {
  const auto percent = [](double part) { return shown_number(100 * part) + " %"; };
  print_table(out, {{"points", std::to_string(v.points)},
                    {"uncovered", std::to_string(v.uncovered)},
                    {"bias", percent(v.bias)},
                    {"rmse", percent(v.rmse)},
                    {"p95", percent(v.p95)}});
  if (v.worst.empty()) return;
  std::vector<std::vector<std::string>> rows{
      {"worst at", "normal", "from records", "from paths", "error"}};
  const auto vector = [](const Vec3d& p) {
    return shown_number(p.x) + "," + shown_number(p.y) + "," + shown_number(p.z);
  };
  for (const VerifyPoint& p : v.worst)
    rows.push_back({vector(p.position), vector(p.normal), shown_number(p.cached),
                    shown_number(p.reference), percent(p.relative_error())});
  out << '\n';
  print_table(out, rows);
}

Json record_errors_json(const RecordErrors& e) {
  Json all = Json::object();
  all["records"] = e.records;
  all["mean"] = e.mean;
  all["median"] = e.median;
  all["p99"] = e.p99;
  all["worst"] = e.worst;
  all["worst_position"] = json_of(e.worst_position);
  all["worst_value"] = e.worst_value;
  all["worst_truth"] = e.worst_truth;
  all["calibration"] = e.calibration;
  all["truth_error"] = e.truth_error;
  return all;
}

void print_record_errors(std::ostream& out, const RecordErrors& e) {
  const auto percent = [](double part) { return shown_number(100 * part) + " %"; };
  print_table(out, {{"records", std::to_string(e.records)},
                    {"median error", percent(e.median)},
                    {"99th percentile", percent(e.p99)},
                    {"worst", percent(e.worst)},
                    {"worst value", shown_number(e.worst_value)},
                    {"its truth", shown_number(e.worst_truth)},
                    {"error over its estimate", shown_number(e.calibration)},
                    {"error of the truths", percent(e.truth_error)}});
}

// C.irc.verify.json: the result with what it holds for.
void save(const VerifyCommandOptions& options, const VerifyOptions& used, const OpenedCache& opened,
          const Verification& v) {
  Json all = Json::object();
  all["fingerprint"] = opened.header.fingerprint.hex();
  all["records"] = opened.cache.size();
  all["settings"] = settings_json(opened.header.settings);
  all["paths"] = used.paths;
  all["seed"] = used.seed;
  all.update(verification_json(v));
  if (options.max_rmse) {
    all["max_rmse"] = *options.max_rmse;
    all["passed"] = v.rmse <= *options.max_rmse;
  }
  write_file_whole(saved_result(options.cache_file), all.dump(2) + '\n');
}

int verify(const VerifyCommandOptions& options, const CommandContext& context) {
  if (options.records && (options.points || options.paths || options.max_rmse ||
                          options.worst_points || options.is_saved))
    throw Error(ErrorKind::Usage,
                "--records: measures records, not points: leave out --points, --paths, --max-rmse, "
                "--worst and --save");
  if (!context.stats_file.empty()) check_writable(context.stats_file);
  if (options.is_saved) check_writable(saved_result(options.cache_file));
  Statistics statistics;
  const Scene scene =
      statistics.timed("load", [&] { return load_scene_verbosely(options.scene, context); });
  const World world = statistics.timed("world", [&] { return World(scene); });
  const OpenedCache opened = open_cache_of_world(options.cache_file, world);
  const Lighting lighting = statistics.timed(
      "lighting", [&] { return Lighting(world, lighting_options(opened.settings, context)); });

  if (options.records) {
    RecordErrorOptions record_options;
    record_options.records = *options.records;
    if (options.seed) record_options.seed = *options.seed;
    record_options.threads = context.threads;
    const RecordErrors errors = statistics.timed("verify", [&] {
      return measure_record_errors(lighting, opened.settings, opened.cache, record_options);
    });
    statistics.records = opened.cache.size();
    statistics.details["records_verified"] = record_errors_json(errors);
    if (context.json)
      print_json(context, record_errors_json(errors));
    else
      print_record_errors(context.out, errors);
    CommandContext stats_alone = context;
    stats_alone.json = false;
    report_statistics(stats_alone, statistics);
    return 0;
  }
  VerifyOptions verify_options;
  if (options.points) verify_options.points = *options.points;
  if (options.paths) verify_options.paths = 2 * ((*options.paths + 1) / 2);
  if (options.seed) verify_options.seed = *options.seed;
  if (options.worst_points) verify_options.worst_points = *options.worst_points;
  verify_options.threads = context.threads;
  const Verification v = statistics.timed("verify", [&] {
    return verify_cache(lighting, opened.settings, opened.cache, verify_options);
  });
  statistics.records = opened.cache.size();
  Json result = verification_json(v);
  result["seconds"] = v.seconds;
  statistics.details["verification"] = result;
  if (options.is_saved) save(options, verify_options, opened, v);
  if (context.json)
    print_json(context, result);
  else
    print_verification(context.out, v);
  CommandContext stats_alone = context;
  stats_alone.json = false;
  report_statistics(stats_alone, statistics);
  // Written so that NaN fails.
  if (options.max_rmse && !(v.rmse <= *options.max_rmse))
    throw Error(ErrorKind::Threshold, printable(options.cache_file.string()) + ": rmse " +
                                          shown_number(v.rmse) + " is above " +
                                          shown_number(*options.max_rmse) +
                                          ": bake with a smaller --error or more --cells");
  return 0;
}

}  // namespace

void add_verify_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb =
      app.add_subcommand("verify", "Compares a cache with traced paths at random points");
  const auto options = std::make_shared<VerifyCommandOptions>();
  verb->add_option_function<std::string>(
          "CACHE", [options](const std::string& text) { options->cache_file = text; }, "Cache file")
      ->required();
  add_scene_options(*verb, context, options->scene);
  add_integer(*verb, "--points", options->points, 1, 10'000'000, "How many points (default 64)")
      ->group("Verification");
  add_integer(*verb, "--paths", options->paths, 2, 100'000'000,
              "Paths at each point (default 4096); their own error is taken out of the RMSE")
      ->group("Verification");
  with_environment(context, *verb,
                   add_parsed(
                       *verb, "--seed", "N", options->seed,
                       [](const std::string& option, const std::string& text) {
                         return std::optional<std::uint64_t>(parse_unsigned(option, text));
                       },
                       "Of the points, paths and gathers (default 1)"))
      ->group("Verification");
  add_number(*verb, "--max-rmse", options->max_rmse, 0, 1e6,
             "Exit code 5 where the relative RMSE is above this")
      ->group("Verification");
  add_integer(*verb, "--worst", options->worst_points, 0, 1'000'000,
              "How many of the worst points are listed (default 5)")
      ->group("Verification");
  add_integer(*verb, "--records", options->records, 1, 10'000'000,
              "Instead: so many records against many gathers at their places")
      ->group("Verification");
  verb->add_flag("--save", options->is_saved,
                 "Also writes the result beside the cache, as CACHE.verify.json")
      ->group("Verification");
  verb->footer(R"(The cache's own settings are used; numbers are relative to the mean irradiance.

Examples:
  brume verify shot.irc shot.json
  brume verify shot.irc shot.json --points 500 --max-rmse 0.05 --save --json)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return verify(*options, context); };
  });
}

}  // namespace brume
