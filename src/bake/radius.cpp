#include "bake/bake.h"
#include "bake/deep_bake.h"
#include "gather/incident_field.h"

namespace brume {

HitLight deep_light(const IrradianceCache& cache, const World& world, double min_radius,
                    int threads, const Scattered& scattered) {
  HitLight light;
  light.layer = kDeepLayer;
  light.min_radius = min_radius;
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
  HitLight light = deep_light(cache, world, deep_settings(settings).min_radius * world.diagonal(),
                              threads, scattered);
  light.reflect = settings.bounces > 0;
  return light;
}

double split_sphere_radius(const GatherResult& gather, const Vec3d& normal,
                           const BakeSettings& settings, double diagonal) {
  // The nearer of what is there and what shines: light scattered close by changes fast too.
  const double distance = std::min(gather.mean_distance, gather.light_distance);
  double radius = std::min(settings.error * distance, settings.max_radius * diagonal);
  // Where nothing arrives distances alone say how far that may hold: a record that reached farther
  // would darken lit neighbours in its plane.
  if (is_black(gather.irradiance)) return std::max(radius, settings.min_radius * diagonal);
  const RgbGradient g = gather.terms.sum();
  Vec3d along = luminance(g);
  along -= normal * normal.dot(along);
  const double slope = along.length(), e = luminance(gather.irradiance);
  // A record may change by `error` of itself over its radius. Beyond, the noise of dark records is
  // cut at 0 and brightens them: indirect light of cornell_wdas_cloud at 256 x 256 is 1.5 % too
  // bright when they may change by all of themselves, 0.8 % at a quarter.
  if (slope > 0) radius = std::min(radius, settings.error * e / slope);
  return std::max(radius, settings.min_radius * diagonal);
}

}  // namespace brume
