// brume bake: fills a cache file with the records that views, or all surfaces, need.
#include "cli/cache_session.h"
#include "cli/commands.h"
#include "cli/environment.h"
#include "cli/frame_options.h"
#include "cli/outputs.h"
#include "cli/progress.h"
#include "cli/shared_options.h"
#include "cli/signals.h"
#include "cli/stopping.h"
#include "core/error.h"

namespace brume {
namespace {

struct BakeOptions {
  SceneOptions scene;
  AccuracyOptions accuracy;
  SizeOptions size;
  CacheOptions cache;
  std::vector<std::string> views;
  bool everywhere = false;
};

BakeRequest make_request(const BakeOptions& options, const Scene& scene,
                         const CommandContext& context, Progress& progress) {
  BakeRequest request;
  request.everywhere = options.everywhere;
  request.threads = context.threads;
  request.progress = progress.callback();
  request.stop_requested = SignalWatch::stop_requested;
  if (options.everywhere) return request;
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

int bake_scene(const BakeOptions& options, const CommandContext& context) {
  if (options.everywhere && !options.views.empty())
    throw Error(ErrorKind::Usage, "--everywhere: needs no views: leave out --views");
  if (!options.cache.file.empty())
    check_writable(with_frame(options.cache.file, options.scene.load.frame));
  if (!context.stats_file.empty()) check_writable(context.stats_file);
  Statistics statistics;
  const Scene scene =
      statistics.timed("load", [&] { return load_scene_verbosely(options.scene, context); });
  const CacheSettings choice = options.cache.resolved(scene.cache, options.scene.load.frame);
  if (choice.file.empty())
    throw Error(ErrorKind::Usage,
                printable(options.scene.file.string()) + ": names no cache file: add -o C.irc");
  if (choice.mode != CacheMode::Read) check_writable(choice.file);

  const BakeSettings settings = options.accuracy.bake_settings(scene.render);
  check_cached_transport(settings, printable(options.scene.file.string()));
  SignalWatch watch;
  Progress progress(context);
  const BakeRequest request = make_request(options, scene, context, progress);
  const World world = statistics.timed("world", [&] { return World(scene); });
  CacheSession session(choice, world, settings);
  const bool needs_bake =
      statistics.timed("coverage", [&] { return session.needs_bake(world, request); });
  if (!needs_bake) {
    statistics.effects = plan_effects(world, settings.bounces, settings.volume_bounces).names();
    statistics.records = session.existing()->records().size();
    if (!session.may_bake()) require_coverage(world, settings, session, request, statistics);
    report(context, session, statistics, false);
    return 0;
  }
  const Lighting lighting = statistics.timed(
      "lighting", [&] { return Lighting(world, lighting_options(settings, context)); });
  statistics.describe(lighting, plan_effects(world, settings.bounces, settings.volume_bounces));
  const BakeResult baked = statistics.timed(
      "bake", [&] { return bake(lighting, settings, request, session.existing().get()); });
  statistics.add_bake(baked.stats);
  statistics.records = baked.cache->records().size();
  statistics.details["layers"] = baked.layers;
  statistics.details["truncation_bound"] = baked.truncation_bound;
  if (!baked.is_stopped) progress.finish();
  const bool is_saved = statistics.timed(
      "write", [&] { return session.save(*baked.cache, baked.stats.records_added); });
  report(context, session, statistics, is_saved);
  return baked.is_stopped ? end_stopped_run(context, SignalWatch::signal(), session.file()) : 0;
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
  add_size_options(*verb, context, options->size);
  add_accuracy_options(*verb, context, options->accuracy);
  verb->footer(R"(Examples:
  brume bake shot.json -o shot.irc
  brume bake shot.json -o shot.irc --views left,right --cache-mode append
  brume bake room.json -o room.irc --everywhere --preset high)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return bake_scene(*options, context); };
  });
}

}  // namespace brume
