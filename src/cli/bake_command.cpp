// brume bake: fills a cache file with the records that views, or all surfaces, need.
#include "cli/cache_session.h"
#include "cli/commands.h"
#include "cli/environment.h"
#include "cli/frame_options.h"
#include "cli/outputs.h"
#include "cli/progress.h"
#include "cli/self_check.h"
#include "cli/shared_options.h"
#include "cli/signals.h"
#include "cli/stopping.h"
#include "cli/text_table.h"
#include "cli/values.h"
#include "core/error.h"

namespace brume {
namespace {

struct BakeOptions {
  SceneOptions scene;
  AccuracyOptions accuracy;
  SizeOptions size;
  CacheOptions cache;
  SelfCheckOptions check;
  std::vector<std::string> views;
  bool everywhere = false, deep_only = false;
  std::optional<Shard> shard;
  std::optional<double> time_limit, seal_interval;
  std::optional<std::uint64_t> record_limit;
  std::optional<bool> survives_power_loss;
};

BakeRequest make_request(const BakeOptions& options, const Scene& scene,
                         const CommandContext& context, Progress& progress) {
  BakeRequest request;
  request.everywhere = options.everywhere;
  request.deep_only = options.deep_only;
  request.threads = context.threads;
  request.shard = options.shard.value_or(Shard());
  request.record_limit = options.record_limit.value_or(request.record_limit);
  request.progress = progress.callback();
  if (options.everywhere || options.deep_only) return request;
  const Size2 size = options.size.resolved(scene.film);
  const auto& names = options.views;
  for (const std::string& name : names.empty() ? std::vector<std::string>{""} : names)
    request.views.push_back({name, scene.find_camera(name), size.x, size.y});
  return request;
}

// Read mode bakes nothing; it says whether anything would have to be.
void require_coverage(const World& world, const BakeSettings& settings, const CacheSession& session,
                      const BakeRequest& request, Statistics& statistics) {
  const Coverage coverage = statistics.timed(
      "coverage", [&] { return measure_coverage(world, settings, *session.existing(), request); });
  statistics.details["points"] = coverage.asked;
  statistics.details["uncovered"] = coverage.uncovered;
  if (coverage.uncovered > 0)
    throw Error(ErrorKind::InvalidInput,
                printable(session.file().string()) + ": " + std::to_string(coverage.uncovered) +
                    " of " + std::to_string(coverage.asked) +
                    " points are not covered: bake with --cache-mode missing");
}

void report(const CommandContext& context, const CacheSession& session, Statistics& statistics,
            bool is_saved) {
  statistics.details["fingerprint"] = session.fingerprint().hex();
  statistics.details["written"] = is_saved;
  report_statistics(context, statistics);
  const std::string file = printable(session.file().string());
  if (is_saved)
    context.note(file + ": " + std::to_string(statistics.records_added) + " records added, " +
                 std::to_string(statistics.records) + " in all");
  else
    context.note(file + ": covers what was asked, left as it is (" +
                 std::to_string(statistics.records) + " records)");
}

// What makes a bake stop early: a signal, or its time.
class StopRequest {
 public:
  explicit StopRequest(const std::optional<double>& seconds) : seconds_(seconds) {}

  bool operator()() const { return SignalWatch::stop_requested() || is_late(); }
  bool is_late() const { return seconds_ && seconds_since(begin_) >= *seconds_; }

 private:
  std::optional<double> seconds_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

int end_early(const BakeOptions& options, const CommandContext& context, const BakeResult& baked,
              const CacheSession& session) {
  const std::filesystem::path checkpoint = session.checkpoint().value_or("");
  if (SignalWatch::stop_requested() && !baked.is_at_record_limit)
    return end_stopped_run(context, SignalWatch::signal(), checkpoint);
  const std::string limit = baked.is_at_record_limit
                                ? "the record limit of " + std::to_string(*options.record_limit)
                                : "the time limit of " + shown_number(*options.time_limit) + " s";
  if (checkpoint.empty())
    throw Error(ErrorKind::InvalidInput, printable(session.file().string()) + ": stopped at " +
                                             limit +
                                             " before there was a record: use a higher one");
  end_run_at_limit(limit, checkpoint);
}

JournalOptions journal_options(const BakeOptions& options, const CommandContext& context) {
  JournalOptions journal;
  if (options.seal_interval)
    journal.seal_interval =
        std::chrono::milliseconds(static_cast<std::int64_t>(*options.seal_interval * 1000));
  journal.survives_power_loss = options.survives_power_loss.value_or(false);
  if (context.verbosity >= 2)
    journal.on_sealed = [&context](std::size_t records) {
      context.info("sealed " + std::to_string(records) + " records");
    };
  return journal;
}

int bake_scene(const BakeOptions& options, const CommandContext& context) {
  const StopRequest stop(options.time_limit);
  if (options.everywhere && !options.views.empty())
    throw Error(ErrorKind::Usage, "--everywhere: needs no views: leave out --views");
  if (options.deep_only && (options.everywhere || !options.views.empty() || options.shard))
    throw Error(
        ErrorKind::Usage,
        "--deep-only: covers no views and is one piece: leave out --views, --everywhere and "
        "--shard");
  require_sense(options.check);
  if (options.check.max_rmse && (options.deep_only || options.shard))
    throw Error(ErrorKind::Usage,
                "--max-rmse: deep records and shards answer nothing by themselves: render with "
                "--cache-mode read and --max-rmse");
  if (!options.cache.file.empty())
    check_writable(with_frame(options.cache.file, options.scene.load.frame));
  if (!context.stats_file.empty()) check_writable(context.stats_file);
  SignalWatch watch(has_checkpoint(options.cache.resolved({}, options.scene.load.frame)));
  Statistics statistics;
  const Scene scene =
      statistics.timed("load", [&] { return load_scene_verbosely(options.scene, context); });
  const CacheSettings choice = options.cache.resolved(scene.cache, options.scene.load.frame);
  if (choice.file.empty())
    throw Error(ErrorKind::Usage,
                printable(options.scene.file.string()) + ": names no cache file: add -o C.irc");
  if (choice.mode != CacheMode::Read) check_writable(choice.file);
  watch.set_checkpoint(has_checkpoint(choice));

  const BakeSettings settings = options.accuracy.bake_settings(scene.render);
  Progress progress(context);
  BakeRequest request = make_request(options, scene, context, progress);
  const World world = statistics.timed("world", [&] { return World(scene); });
  CacheSession session(choice, world, settings);
  const bool needs_bake =
      statistics.timed("coverage", [&] { return session.needs_bake(world, request); });
  const auto make_lighting = [&] {
    return statistics.timed("lighting",
                            [&] { return Lighting(world, lighting_options(settings, context)); });
  };
  if (!needs_bake) {
    statistics.effects = plan_effects(world, settings.bounces, settings.volume_bounces).names();
    statistics.records = session.existing()->size();
    if (!session.may_bake()) require_coverage(world, settings, session, request, statistics);
    std::optional<AnswerCheck> check;
    if (options.check.is_asked_for()) {
      const Lighting lighting = make_lighting();
      check =
          tell_check(check_request(options.check, lighting, settings, *session.existing(), request,
                                   nullptr, session.known_check(request_hash(request)), statistics),
                     *session.existing(), context, statistics);
    }
    report(context, session, statistics, false);
    require_max_rmse(options.check, check, session.file().string());
    return 0;
  }
  session.begin(world, journal_options(options, context), request);
  request.stop_requested = stop;
  request.snapshot_requested = SignalWatch::take_hangup;
  request.snapshot = [&](std::shared_ptr<const IrradianceCache> cache, const DeepStats& deep) {
    session.save_snapshot(*cache, deep);
    context.note(printable(session.file().string()) + ": " + std::to_string(cache->size()) +
                 " records so far");
  };
  const Lighting lighting = make_lighting();
  statistics.describe(lighting, plan_effects(world, settings.bounces, settings.volume_bounces));
  watch.remember();
  const BakeResult baked = statistics.timed(
      "bake", [&] { return bake(lighting, settings, request, session.existing().get()); });
  statistics.add_bake(baked.stats);
  statistics.records = baked.cache->size();
  statistics.describe(baked.deep);
  if (!baked.is_stopped) progress.finish();
  std::optional<CheckedRequest> checked;
  if (!baked.is_stopped)
    checked =
        check_request(options.check, lighting, settings, *baked.cache, request, baked.scattered,
                      session.known_check(request_hash(request)), statistics);
  const bool is_saved =
      statistics.timed("write", [&] { return session.save(baked, request, checked); });
  const auto check = tell_check(checked, *baked.cache, context, statistics);
  report(context, session, statistics, is_saved);
  require_max_rmse(options.check, check, session.file().string());
  if (baked.is_stopped && choice.mode == CacheMode::New)
    context.note("to go on from here: --cache-mode missing; new begins again");
  return baked.is_stopped ? end_early(options, context, baked, session) : 0;
}

// "i/n", i from 0.
std::optional<Shard> parse_shard(const std::string& option, const std::string& text) {
  const std::string expected = "a part of a whole counted from 0, like 0/4 to 3/4";
  const std::size_t slash = text.find('/');
  if (slash == std::string::npos) refuse_value(option, text, expected);
  Shard shard;
  shard.count = static_cast<std::uint32_t>(
      parse_integer(option, text.substr(slash + 1), 1, ShardSet::kMaxShards));
  shard.index = static_cast<std::uint32_t>(
      parse_integer(option, text.substr(0, slash), 0, ShardSet::kMaxShards));
  if (shard.index >= shard.count) refuse_value(option, text, expected);
  return shard;
}

void add_work_options(CLI::App& verb, CommandContext& context, BakeOptions& options) {
  const auto group = [](CLI::Option* option) { option->group("Work"); };
  group(add_parsed(verb, "--shard", "I/N", options.shard, parse_shard,
                   "Bakes part I, from 0, of N that many machines bake; `brume merge` joins them"));
  group(with_environment(context, verb,
                         add_number(verb, "--time-limit", options.time_limit, 0, 1e9,
                                    "Stops after so many seconds, with what there is then")));
  group(with_environment(context, verb,
                         add_parsed(
                             verb, "--record-limit", "N", options.record_limit,
                             [](const std::string& option, const std::string& text) {
                               return std::optional<std::uint64_t>(parse_unsigned(option, text));
                             },
                             "Stops before the cache holds more records than this")));
  group(add_number(verb, "--seal-interval", options.seal_interval, 0, 3600,
                   "Seconds of work that being killed may cost (default 1)"));
  group(add_choice<bool>(
      verb, "--durable", {{"process", false}, {"power", true}}, options.survives_power_loss,
      "What sealed records survive: the end of the process (default), or a power "
      "cut too, which costs a disk's sync each time"));
}

}  // namespace

void add_bake_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb = app.add_subcommand("bake", "Precomputes irradiance records into a cache file");
  const auto options = std::make_shared<BakeOptions>();
  add_scene_options(*verb, context, options->scene);
  add_path(*verb, "-o,--output", options->cache.file, "C.irc",
           "Cache file (default: the scene's cache.file)")
      ->group("Cache");
  add_cache_mode_option(*verb, context, options->cache);
  add_parsed(
      *verb, "--views", "A,B,...", options->views,
      [](const std::string&, const std::string& text) { return parse_list(text); },
      "Cameras by name whose frames are to be covered (default: the one that render takes)")
      ->group("Frame");
  verb->add_flag("--everywhere", options->everywhere, "Covers all surfaces, whatever sees them")
      ->group("Frame");
  verb->add_flag("--deep-only", options->deep_only,
                 "Only the deep records, solved for all bounces, that every view and shard begins "
                 "with: copy the cache, and bake them into the copies")
      ->group("Frame");
  add_size_options(*verb, context, options->size);
  add_work_options(*verb, context, *options);
  add_self_check_options(*verb, context, options->check);
  add_accuracy_options(*verb, context, options->accuracy);
  verb->footer(R"(Examples:
  brume bake shot.json -o shot.irc
  brume bake shot.json -o shot.irc --views left,right --cache-mode append
  brume bake room.json -o room.irc --everywhere --preset high
  brume bake shot.json -o shard3.irc --shard 3/16
  brume bake shot.json -o deep.irc --deep-only

A bake that is ended, whatever ends it, is gone on with by the same command: what was sealed beside the
cache, in FILE.part, is not baked again. USR1, TERM and INT write what there is and end it (exit code 75);
HUP writes what there is, and the bake goes on.)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return bake_scene(*options, context); };
  });
}

}  // namespace brume
