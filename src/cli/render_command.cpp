// brume render: load, bake what is missing, render, write.
#include <cmath>
#include <set>

#include "cli/cache_session.h"
#include "cli/commands.h"
#include "cli/explain_pixel.h"
#include "cli/file_magic.h"
#include "cli/progress.h"
#include "cli/render_metadata.h"
#include "cli/render_options.h"
#include "cli/signals.h"
#include "cli/stopping.h"
#include "core/error.h"
#include "render/cached_renderer.h"
#include "render/preview.h"

namespace brume {
namespace {

namespace fs = std::filesystem;

// What will be written, known before anything is loaded.
struct Plan {
  std::vector<OutputSettings> images;
  CacheSettings cache;
};

Plan make_plan(const RenderOptions& options) {
  Plan plan;
  const auto& frame = options.scene.load.frame;
  if (!names_a_grid_file(options.scene.file)) {
    SceneFileOptions peek = options.scene.file_options();
    peek.load_data = false;
    const Scene scene = load_scene(options.scene.file, peek);
    plan.cache = scene.cache;
    plan.images = scene.outputs;
  }
  plan.cache = options.cache.resolved(plan.cache, frame);
  if (options.is_path()) plan.cache.file.clear();
  if (!options.output.empty()) plan.images = {{options.output, options.aovs}};
  if (options.pixel) plan.images.clear();
  if (plan.images.empty() && !options.pixel)
    throw Error(ErrorKind::Usage,
                printable(options.scene.file.string()) + ": names no outputs: add -o OUT.exr");
  for (OutputSettings& image : plan.images) {
    image.file = with_frame(image.file, frame);
    if (!options.aovs.empty()) image.aovs = options.aovs;
  }
  return plan;
}

// False: everything is there already, and may stay.
bool check_plan(const Plan& plan, const RenderOptions& options, const CommandContext& context) {
  std::vector<fs::path> files;
  for (const OutputSettings& image : plan.images) files.push_back(image.file);
  if (!options.preview.empty())
    files.push_back(with_frame(options.preview, options.scene.load.frame));
  if (!outputs_are_wanted(files, options.existing.value_or(ExistingPolicy::Overwrite), context))
    return false;
  if (!plan.cache.file.empty() && plan.cache.mode != CacheMode::Read)
    check_writable(plan.cache.file);
  if (!context.stats_file.empty()) check_writable(context.stats_file);
  // Unknown layers show now, not after hours.
  const PixelFilm probe(1, 1);
  for (const OutputSettings& image : plan.images) {
    const auto developed = probe.develop({options.half_colour.value_or(true), image.aovs});
    if (!options.preview.empty() && &image == &plan.images.front())
      (void)developed.image.layer(options.preview_layer, "--preview-layer");
  }
  return true;
}

// One run of `render`, stage by stage.
class RenderRun {
 public:
  RenderRun(const RenderOptions& options, const Plan& plan, const CommandContext& context)
      : options_(options), plan_(plan), context_(context), progress_(context) {}

  int run();

 private:
  void load();
  // Both return 0, or the exit code of a stopped run.
  int render_with_records(const World& world, const CameraRays& rays);
  int render_with_paths(const World& world, const CameraRays& rays);
  BakeRequest request_of_view() const;
  void check_answers_of_view(const Lighting& lighting, const BakeSettings& settings,
                             const CacheSession& session);
  int bake_view(const Lighting& lighting, const BakeSettings& settings, CacheSession& session);
  void write_images(const World& world, const CameraRays& rays);
  void summarise() const;

  const RenderOptions& options_;
  const Plan& plan_;
  const CommandContext& context_;
  Progress progress_;
  SignalWatch watch_;
  Statistics statistics_;
  Scene scene_;
  Size2 size_;
  CropIntervals crop_;
  std::optional<PixelFilm> film_;
  std::shared_ptr<const IrradianceCache> cache_;
  Scattered scattered_;  // Of this run's bake.
  std::optional<Fingerprint> cache_fingerprint_;
  std::optional<CheckedRequest> checked_;
  std::optional<AnswerCheck> check_;
  int samples_ = 0;
};

void RenderRun::load() {
  statistics_.timed("load", [&] { scene_ = load_scene_verbosely(options_.scene, context_); });
  size_ = options_.size.resolved(scene_.film);
  options_.check_size(size_);
  crop_ = crop_of(options_, size_);
}

int RenderRun::run() {
  load();
  const CameraRays rays(scene_.find_camera(options_.camera), size_.x, size_.y);
  const World world = statistics_.timed("world", [&] { return World(scene_); });
  film_.emplace(size_.x, size_.y);
  const int stopped =
      options_.is_path() ? render_with_paths(world, rays) : render_with_records(world, rays);
  if (stopped) return stopped;
  progress_.finish();
  if (!options_.pixel) {
    write_images(world, rays);
    report_statistics(context_, statistics_);
    summarise();
    require_max_rmse(options_.check, check_, plan_.cache.file.string());
  }
  return 0;
}

BakeRequest RenderRun::request_of_view() const {
  BakeRequest request;
  request.views = {{options_.camera, scene_.find_camera(options_.camera), size_.x, size_.y}};
  request.threads = context_.threads;
  request.stop_requested = SignalWatch::stop_requested;
  request.deep_only = options_.gather_everywhere;
  return request;
}

void RenderRun::check_answers_of_view(const Lighting& lighting, const BakeSettings& settings,
                                      const CacheSession& session) {
  const BakeRequest request = request_of_view();
  if (!options_.pixel)
    checked_ = check_request(options_.check, lighting, settings, *cache_, request, scattered_,
                             session.known_check(request_hash(request)), statistics_);
}

int RenderRun::bake_view(const Lighting& lighting, const BakeSettings& settings,
                         CacheSession& session) {
  cache_ = session.existing();
  BakeRequest request = request_of_view();
  request.progress = progress_.callback();
  const World& world = lighting.world();
  if (!statistics_.timed("coverage", [&] { return session.needs_bake(world, request); })) return 0;
  session.begin(world, {}, request);
  if (session.has_file()) {
    request.snapshot_requested = SignalWatch::take_hangup;
    request.snapshot = [&](std::shared_ptr<const IrradianceCache> cache, const DeepStats& deep) {
      session.save_snapshot(*cache, deep);
    };
  }
  cache_ = session.existing();
  const BakeResult baked =
      statistics_.timed("bake", [&] { return bake(lighting, settings, request, cache_.get()); });
  statistics_.add_bake(baked.stats);
  statistics_.describe(baked.deep);
  cache_ = baked.cache;
  scattered_ = baked.scattered;
  if (!baked.is_stopped) progress_.finish();
  if (!baked.is_stopped) check_answers_of_view(lighting, settings, session);
  const bool is_saved =
      statistics_.timed("write", [&] { return session.save(baked, request, checked_); });
  if (is_saved)
    context_.note(printable(session.file().string()) + ": " +
                  std::to_string(baked.stats.records_added) + " records added, " +
                  std::to_string(cache_->size()) + " in all");
  if (!baked.is_stopped) return 0;
  return end_stopped_run(context_, SignalWatch::signal(), session.checkpoint().value_or(""));
}

int RenderRun::render_with_records(const World& world, const CameraRays& rays) {
  const BakeSettings settings = options_.accuracy.bake_settings(scene_.render);
  watch_.set_checkpoint(has_checkpoint(plan_.cache));
  CacheSession session(plan_.cache, world, settings);
  const Lighting lighting = statistics_.timed(
      "lighting", [&] { return Lighting(world, lighting_options(settings, context_)); });
  statistics_.describe(lighting, plan_effects(world, settings.bounces, settings.volume_bounces));
  watch_.remember();
  if (const int stopped = bake_view(lighting, settings, session)) return stopped;
  cache_fingerprint_ = session.fingerprint();
  statistics_.records = cache_->size();
  if (!checked_) check_answers_of_view(lighting, settings, session);
  check_ = tell_check(checked_, *cache_, context_, statistics_);

  CachedRenderOptions render;
  samples_ = render.samples = options_.sample_count();
  render.eye_shells = options_.eye_shell_count();
  render.step_voxels = settings.gather.step_voxels;
  render.threads = context_.threads;
  render.crop_x = crop_.x;
  render.crop_y = crop_.y;
  render.gather_everywhere = options_.gather_everywhere;
  render.scattered = scattered_;
  render.progress = progress_.callback("render");
  render.stop_requested = SignalWatch::stop_requested;
  const CachedRenderResult result = statistics_.timed(
      "render", [&] { return render_cached(lighting, settings, *cache_, rays, render, *film_); });
  statistics_.counters += result.counters;
  if (result.is_stopped)
    return end_stopped_run(context_, SignalWatch::signal(), session.checkpoint().value_or(""));
  if (options_.pixel)
    explain_pixel(context_, {*options_.pixel, size_, samples_,
                             film_->at(options_.pixel->x, options_.pixel->y), world, rays,
                             cache_.get(), &settings});
  return 0;
}

int RenderRun::render_with_paths(const World& world, const CameraRays& rays) {
  const BakeSettings settings = options_.accuracy.bake_settings(scene_.render);
  PathTracerOptions path;
  path.transport = options_.transport.value_or(Transport::Full);
  path.bounces = settings.bounces;
  path.volume_bounces = settings.volume_bounces;
  path.seed = settings.seed;
  path.threads = context_.threads;
  path.samples = options_.sample_count();
  path.noise = options_.noise;
  path.crop_x = crop_.x;
  path.crop_y = crop_.y;
  path.progress = progress_.callback("render");
  path.stop_requested = SignalWatch::stop_requested;
  watch_.remember();
  statistics_.effects = plan_effects(world, settings.bounces, settings.volume_bounces).names();
  const PathTracerResult result =
      statistics_.timed("render", [&] { return trace_paths(world, rays, path, *film_); });
  if (SignalWatch::stop_requested()) return end_stopped_run(context_, SignalWatch::signal(), {});
  samples_ = result.samples;
  statistics_.counters.rays += result.rays;
  statistics_.details["lookups"] = result.lookups;
  statistics_.details["estimated_error"] = result.estimated_error;
  if (options_.pixel)
    explain_pixel(context_, {*options_.pixel, size_, samples_,
                             film_->at(options_.pixel->x, options_.pixel->y), world, rays});
  return 0;
}

void RenderRun::write_images(const World& world, const CameraRays& rays) {
  std::size_t bad_pixels = 0;
  bool is_first = true;
  for (const OutputSettings& output : plan_.images) {
    const auto developed = film_->develop({options_.half_colour.value_or(true), output.aovs});
    bad_pixels = std::max(bad_pixels, developed.bad_pixels);
    const RenderProvenance provenance{context_.arguments,
                                      scene_,
                                      rays,
                                      statistics_,
                                      world.fingerprint(),
                                      cache_fingerprint_,
                                      check_,
                                      developed.bad_pixels,
                                      samples_,
                                      options_.is_reproducible()};
    const std::size_t clamped = statistics_.timed("write", [&] {
      return write_exr(output.file, developed.image, render_metadata(provenance));
    });
    if (clamped)
      context_.warn(printable(output.file.string()) + ": " + std::to_string(clamped) +
                    " values exceed half floats and were clamped: use --depth float to keep them");
    if (is_first && !options_.preview.empty()) {
      PreviewOptions preview;
      preview.layer = options_.preview_layer;
      const auto stops = options_.exposure.value_or(std::nullopt);
      preview.automatic_exposure = !stops.has_value();
      preview.exposure = stops.value_or(0);
      write_preview(with_frame(options_.preview, options_.scene.load.frame), developed.image,
                    preview);
    }
    is_first = false;
  }
  if (bad_pixels)
    context_.warn(std::to_string(bad_pixels) +
                  " pixels were not finite and became black: please report this scene");
  statistics_.details["bad_pixels"] = bad_pixels;
  statistics_.details["bad_voxels"] = scene_.bad_voxels.total();
  statistics_.details["samples"] = samples_;
  statistics_.details["pixels"] = crop_.pixels;
}

void RenderRun::summarise() const {
  std::string stages;
  for (const auto& [stage, seconds] : statistics_.seconds) {
    char text[32];
    std::snprintf(text, sizeof text, " %.2f s", seconds);
    stages += (stages.empty() ? "" : ", ") + stage + text;
  }
  context_.note(printable(plan_.images.front().file.string()) + ": " + std::to_string(size_.x) +
                "x" + std::to_string(size_.y) + ", " + std::to_string(samples_) + " samples, " +
                std::to_string(statistics_.records) + " records; " + stages);
  if (statistics_.counters.fallback_gathers > 0 && !options_.gather_everywhere)
    context_.note(std::to_string(statistics_.counters.fallback_gathers) +
                  " points had no record and were gathered on the spot");
}

int render(const RenderOptions& options, const CommandContext& context) {
  check_combinations(options);
  const Plan plan = make_plan(options);
  if (!check_plan(plan, options, context)) return 0;
  return RenderRun(options, plan, context).run();
}

}  // namespace

void add_render_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb = app.add_subcommand("render", "Renders a frame");
  const auto options = std::make_shared<RenderOptions>();
  add_render_options(*verb, context, *options);
  verb->footer(R"(Examples:
  brume render shot.json -o shot.exr --preview shot.png
  brume render shot.json -o shot.exr --cache shot.irc -t 8
  brume render smoke.vdb -o smoke.exr --res 1280x720
  brume render shot.json -o reference.exr --integrator path --transport cached --noise 0.01
  brume render shot.json --pixel 320,200 --json)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return render(*options, context); };
  });
}

}  // namespace brume
