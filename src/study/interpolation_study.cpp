#include "study/interpolation_study.h"

#include "bake/placement.h"
#include "core/random.h"

namespace brume {

InterpolationStudy study_interpolation(const StudyScene& scene, const IrradianceCache& cache,
                                       const RegradientResult& caches,
                                       const InterpolationOptions& options, const StudyRun& run) {
  InterpolationStudy study;
  study.records = caches.caches[0].records().size();
  const double pixels = double(options.view.width) * options.view.height;
  const int stride =
      std::max(options.least_stride, static_cast<int>(std::sqrt(pixels / options.points)));
  // Off the lattice of pixels where most records lie.
  const PixelRect frame{stride / 2, stride / 2, options.view.width, options.view.height};
  const int layer = top_layer(scene.settings());

  std::vector<SurfacePoint> points;
  for (const SurfacePoint& p : view_points(scene.world(), options.view, frame, stride, false))
    if (caches.caches[0].covers({layer, p.position, p.normal, p.min_radius})) points.push_back(p);
  std::array<std::vector<PointGather>, 2> references;
  GatherOptions gather = with_cells(scene.settings().gather, options.reference_cells);
  gather.gradient = GradientMode::None;
  for (std::size_t half = 0; half < 2; ++half) {
    std::vector<GatherPoint> at;
    for (std::size_t i = 0; i < points.size(); ++i)
      at.push_back({points[i].position, points[i].normal, points[i].offset,
                    random_key(options.seed, std::uint64_t{0x696e746572}, half, i)});
    references[half] =
        gather_points(scene, gather, light_below(cache, layer), at, "converged irradiance", run);
  }
  std::array<NoiseFreeError, kModeCount> errors;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SurfacePoint& p = points[i];
    for (std::size_t m = 0; m < kModeCount; ++m)
      errors[m].add(
          luminance(
              caches.caches[m].irradiance({layer, p.position, p.normal, p.min_radius}).irradiance),
          luminance(references[0][i].irradiance), luminance(references[1][i].irradiance));
    study.media_share += references[0][i].media_share / double(points.size());
  }
  study.points = static_cast<int>(points.size());
  study.reference_noise = errors[0].reference_noise();
  for (std::size_t m = 0; m < kModeCount; ++m) study.relmse[m] = errors[m].relmse();
  return study;
}

}  // namespace brume
