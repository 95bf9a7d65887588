#include "study/interpolation_study.h"

#include "bake/placement.h"
#include "core/random.h"

namespace brume {
namespace {

constexpr std::uint64_t kThinning = 4;
constexpr float kWidening = 2;

IrradianceCache sparse_cache(const IrradianceCache& cache) {
  std::vector<SurfaceRecord> kept;
  for (SurfaceRecord r : cache.records()) {
    if (random_key(r.key) % kThinning != 0) continue;
    for (float& radius : r.radius) radius *= kWidening;
    r.flags &= ~kClearFlag;
    kept.push_back(r);
  }
  return {std::move(kept), cache.origin()};
}

using References = std::array<std::vector<PointGather>, 2>;

InterpolationErrors errors_of(const World& world,
                              const std::array<IrradianceCache, kModeCount>& caches,
                              const std::vector<SurfacePoint>& points,
                              const References& references) {
  InterpolationErrors result;
  result.records = caches[0].records().size();
  for (std::size_t m = 0; m < kModeCount; ++m) {
    NoiseFreeError error;
    result.points = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const SurfacePoint& p = points[i];
      const InterpolatedIrradiance e =
          caches[m].irradiance(pixel_query(world, p.position, p.normal, p.min_radius));
      if (e.records == 0) continue;
      ++result.points;
      error.add(luminance(e.irradiance), luminance(references[0][i].irradiance),
                luminance(references[1][i].irradiance));
    }
    result.relmse[m] = error.relmse();
    result.relative_rms[m] = error.relative_rms();
  }
  return result;
}

}  // namespace

InterpolationStudy study_interpolation(const StudyScene& scene, const IrradianceCache& cache,
                                       const RegradientResult& caches,
                                       const InterpolationOptions& options, const StudyRun& run) {
  InterpolationStudy study;
  const double pixels = double(options.view.width) * options.view.height;
  const int stride =
      kPointsPerPixel *
      std::max(options.least_stride, static_cast<int>(std::sqrt(pixels / options.points)));
  // Off the lattice of pixels where most records lie.
  const PixelRect frame{stride / 2, stride / 2, kPointsPerPixel * options.view.width,
                        kPointsPerPixel * options.view.height};

  std::vector<SurfacePoint> points;
  for (const SurfacePoint& p : view_points(scene.world(), options.view, frame, stride, false))
    if (caches.caches[0].covers(pixel_query(scene.world(), p.position, p.normal, p.min_radius)))
      points.push_back(p);
  References references;
  GatherOptions gather = with_cells(scene.settings().gather, options.reference_cells);
  gather.gradient = GradientMode::None;
  for (std::size_t half = 0; half < 2; ++half) {
    std::vector<GatherPoint> at;
    for (std::size_t i = 0; i < points.size(); ++i)
      at.push_back({points[i].position, points[i].normal, points[i].offset,
                    random_key(options.seed, std::uint64_t{0x696e746572}, half, i)});
    references[half] = gather_points(
        scene, gather, light_below(cache, scene.settings(), scene.world(), run.threads), at,
        "converged irradiance", run);
  }
  NoiseFreeError own;
  for (std::size_t i = 0; i < points.size(); ++i) {
    own.add(0, luminance(references[0][i].irradiance), luminance(references[1][i].irradiance));
    study.media_share += references[0][i].media_share / double(points.size());
  }
  study.reference_noise = own.reference_noise();
  study.as_baked = errors_of(scene.world(), caches.caches, points, references);
  std::array<IrradianceCache, kModeCount> sparse;
  for (std::size_t m = 0; m < kModeCount; ++m) sparse[m] = sparse_cache(caches.caches[m]);
  study.sparse = errors_of(scene.world(), sparse, points, references);
  return study;
}

}  // namespace brume
