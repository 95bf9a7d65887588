// brume verify: a cache's answers against brute force.
#include "cli/cache_session.h"
#include "cli/commands.h"
#include "cli/environment.h"
#include "cli/outputs.h"
#include "cli/shared_options.h"
#include "cli/text_table.h"
#include "cli/values.h"
#include "core/error.h"
#include "study/verify.h"

namespace brume {
namespace {

struct VerifyCommandOptions {
  SceneOptions scene;
  std::filesystem::path cache_file;
  std::optional<int> points;
  std::optional<Size2> cells;
  std::optional<std::uint64_t> seed;
  std::optional<double> max_rmse;
};

Json verification_json(const Verification& v) {
  Json all = Json::object();
  all["points"] = v.points;
  all["uncovered"] = v.uncovered;
  all["bias"] = v.bias;
  all["rmse"] = v.rmse;
  all["p95"] = v.p95;
  all["worst"] = {{"position", json_of(v.worst.position)},
                  {"normal", json_of(v.worst.normal)},
                  {"cached", v.worst.cached},
                  {"reference", v.worst.reference},
                  {"relative_error", v.worst.relative_error()}};
  all["seconds"] = v.seconds;
  return all;
}

void print_verification(std::ostream& out, const Verification& v) {
  const auto percent = [](double part) { return shown_number(100 * part) + " %"; };
  print_table(out, {{"points", std::to_string(v.points)},
                    {"uncovered", std::to_string(v.uncovered)},
                    {"bias", percent(v.bias)},
                    {"rmse", percent(v.rmse)},
                    {"p95", percent(v.p95)},
                    {"worst", percent(v.worst.relative_error())}});
  out << "worst at " << shown_number(v.worst.position.x) << ',' << shown_number(v.worst.position.y)
      << ',' << shown_number(v.worst.position.z) << ": " << shown_number(v.worst.cached)
      << " from records, " << shown_number(v.worst.reference) << " by brute force\n";
}

int verify(const VerifyCommandOptions& options, const CommandContext& context) {
  if (!context.stats_file.empty()) check_writable(context.stats_file);
  Statistics statistics;
  const Scene scene =
      statistics.timed("load", [&] { return load_scene_verbosely(options.scene, context); });
  const World world = statistics.timed("world", [&] { return World(scene); });
  const OpenedCache opened = open_cache_of_world(options.cache_file, world);
  const Lighting lighting = statistics.timed(
      "lighting", [&] { return Lighting(world, lighting_options(opened.settings, context)); });

  VerifyOptions verify_options;
  if (options.points) verify_options.points = *options.points;
  if (options.cells) {
    verify_options.cells_theta = options.cells->x;
    verify_options.cells_phi = options.cells->y;
  }
  if (options.seed) verify_options.seed = *options.seed;
  verify_options.threads = context.threads;
  const Verification v = statistics.timed("verify", [&] {
    return verify_cache(lighting, opened.settings, opened.cache, verify_options);
  });
  statistics.records = opened.cache.records().size();
  statistics.details["verification"] = verification_json(v);
  if (context.json)
    print_json(context, verification_json(v));
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
      app.add_subcommand("verify", "Compares a cache with brute force at random points");
  const auto options = std::make_shared<VerifyCommandOptions>();
  verb->add_option_function<std::string>(
          "CACHE", [options](const std::string& text) { options->cache_file = text; }, "Cache file")
      ->required();
  add_scene_options(*verb, context, options->scene);
  add_integer(*verb, "--points", options->points, 1, 10'000'000, "How many points (default 64)")
      ->group("Verification");
  add_parsed(
      *verb, "--cells", "MxN", options->cells,
      [](const std::string& option, const std::string& text) {
        return std::optional<Size2>(parse_size(option, text, 4096));
      },
      "Hemisphere cells of the brute-force gathers (default 64x201)")
      ->group("Verification");
  with_environment(context, *verb,
                   add_parsed(
                       *verb, "--seed", "N", options->seed,
                       [](const std::string& option, const std::string& text) {
                         return std::optional<std::uint64_t>(parse_unsigned(option, text));
                       },
                       "Of the points and gathers (default 1)"))
      ->group("Verification");
  add_number(*verb, "--max-rmse", options->max_rmse, 0, 1e6,
             "Exit code 5 where the relative RMSE is above this")
      ->group("Verification");
  verb->footer(R"(The cache's own settings are used; numbers are relative to the mean irradiance.

Examples:
  brume verify shot.irc shot.json
  brume verify shot.irc shot.json --points 500 --max-rmse 0.05 --json)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return verify(*options, context); };
  });
}

}  // namespace brume
