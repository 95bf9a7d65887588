#include "bake/bake.h"
#include "bake/deep_bake.h"
#include "gather/incident_field.h"

namespace brume {

HitLight deep_light(const IrradianceCache& cache, const World& world, int threads,
                    const Scattered& scattered) {
  HitLight light;
  light.layer = kDeepLayer;
  if (!cache.records().empty() && cache.records().front().layer() == kDeepLayer)
    light.cache = &cache;
  if (scattered && scattered->records() == cache.volume())
    light.scattered = scattered;
  else if (cache.volume()->size() > 0)
    light.scattered = std::make_shared<IncidentField>(world, cache.volume(), threads);
  return light;
}

HitLight light_below(const IrradianceCache& cache, const BakeSettings& settings, const World& world,
                     int threads, const Scattered& scattered) {
  HitLight light = deep_light(cache, world, threads, scattered);
  light.reflect = settings.bounces > 0;
  return light;
}

double record_radius(const GatherResult& gather, const Vec3d& normal, double clearance,
                     const BakeSettings& settings, double unit) {
  // Where nothing rises above the plane, light is the same all over it; floats end there.
  constexpr double kFarthest = 1e15, kNearest = 1e-30;
  // The nearer of what is there and what shines: light scattered close by changes fast too.
  const double distance = std::min(gather.mean_distance, gather.light_distance);
  double radius = std::min(
      {settings.error * distance, double(gather.nearest), settings.max_radius / unit, kFarthest});
  // What is small and near a dark record may have been missed: it must not darken that.
  if (is_black(gather.irradiance)) radius = std::min(radius, settings.error * clearance);
  const RgbGradient g = gather.terms.sum();
  Vec3d along = luminance(g);
  along -= normal * normal.dot(along);
  const double slope = along.length(), e = luminance(gather.irradiance);
  // A record may change by `error` of itself over its radius. Beyond, the noise of dark records is
  // cut at 0 and brightens them: indirect light of cornell_wdas_cloud at 256 x 256 is 1.5 % too
  // bright when they may change by all of themselves, 0.8 % at a quarter.
  if (slope > 0 && e > 0) radius = std::min(radius, settings.error * e / slope);
  return std::max(radius, kNearest);
}

IrradianceQuery pixel_query(const World& world, const Vec3d& position, const Vec3d& normal,
                            double footprint) {
  constexpr int kMostStretches = 2;
  return {kTopLayer, position, normal, footprint, &world.tracer(), kMostStretches};
}

}  // namespace brume
