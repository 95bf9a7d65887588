#include "study/study_scene.h"

#include "core/error.h"
#include "core/parallel.h"

namespace brume {

StudyScene::StudyScene(Scene scene, const BakeSettings& settings, const StudyRun& run)
    : scene_(std::move(scene)),
      world_(scene_),
      settings_(settings),
      lighting_(world_, LightingOptions{.depth = settings.light_depth,
                                        .march = {.step_voxels = settings.gather.step_voxels},
                                        .threads = run.threads}),
      effects_(plan_effects(world_, settings.bounces, settings.volume_bounces)) {}

std::vector<PointGather> gather_points(const StudyScene& scene, const GatherOptions& options,
                                       const HitLight& light,
                                       const std::vector<GatherPoint>& points,
                                       const std::string& stage, const StudyRun& run) {
  std::vector<PointGather> all(points.size());
  std::vector<std::unique_ptr<Gatherer>> gatherers(
      static_cast<std::size_t>(resolve_thread_count(run.threads)));
  const bool has_gradients = options.gradient != GradientMode::None;
  GatherOptions asked = options;
  if (has_gradients) asked.gradient = GradientMode::Full;
  run.each(stage, points.size(), [&](std::size_t i, int slot) {
    auto& gatherer = gatherers[static_cast<std::size_t>(slot)];
    if (!gatherer) gatherer = std::make_unique<Gatherer>(scene.lighting(), scene.effects(), asked);
    Counters counters;
    const GatherResult g = gatherer->gather(points[i], light, counters);
    PointGather& p = all[i];
    p.irradiance = g.irradiance;
    const double e = luminance(g.irradiance);
    p.media_share = e > 0 ? luminance(g.irradiance_media) / e : 0;
    p.rotational = g.rotational;
    if (!has_gradients) return;
    for (std::size_t m = 0; m < kModeCount; ++m)
      p.gradient[m] = gatherer->gradient(kGradientModes[m]).sum();
  });
  return all;
}

GatherOptions with_cells(GatherOptions options, int cells_theta) {
  options.cells_theta = cells_theta;
  options.cells_phi = static_cast<int>(std::lround(kPi * cells_theta));
  return options;
}

BakeResult bake_layers_below(const StudyScene& scene, const std::string& stage,
                             const StudyRun& run) {
  BakeRequest request;
  request.deep_only = true;
  request.threads = run.threads;
  request.stop_requested = run.stop_requested;
  if (run.progress)
    request.progress = [&](const std::string& inner, double fraction) {
      run.progress(stage + ", " + inner, fraction);
    };
  BakeResult baked = bake(scene.lighting(), scene.settings(), request, nullptr);
  run.check_stop();
  return baked;
}

void NoiseFreeError::add(double value, double first, double second) {
  samples_.push_back({value, first, second});
}

double NoiseFreeError::mean_reference() const {
  double sum = 0;
  for (const auto& [value, first, second] : samples_) sum += 0.5 * (first + second);
  return samples_.empty() ? 0 : sum / double(samples_.size());
}

double NoiseFreeError::relmse() const {
  const double floor = 0.01 * mean_reference();
  double sum = 0;
  for (const auto& [value, first, second] : samples_) {
    const double reference = 0.5 * (first + second);
    const double scale = reference * reference + floor * floor;
    if (scale > 0) sum += (value - first) * (value - second) / scale;
  }
  return samples_.empty() ? 0 : sum / double(samples_.size());
}

double NoiseFreeError::relative_rms() const {
  const double mean = mean_reference();
  double sum = 0;
  for (const auto& [value, first, second] : samples_) sum += (value - first) * (value - second);
  return mean > 0 ? std::sqrt(std::max(0.0, sum / double(samples_.size()))) / mean : 0;
}

double NoiseFreeError::reference_noise() const {
  const double mean = mean_reference();
  double sum = 0;
  for (const auto& [value, first, second] : samples_) sum += (first - second) * (first - second);
  return mean > 0 ? std::sqrt(sum / double(samples_.size())) / 2 / mean : 0;
}

}  // namespace brume
