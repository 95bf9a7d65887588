#include "render/picture_irradiance.h"

namespace brume {

InterpolatedIrradiance PictureIrradiance::answer(const Hit& hit, const Vec3d& normal,
                                                 double footprint, bool may_gather,
                                                 std::uint64_t key, Counters& counters) {
  InterpolatedIrradiance e =
      cache_.irradiance(pixel_query(lighting_.world(), hit.position, normal, footprint));
  ++counters.cache_queries;
  counters.cache_clamps += e.clamped;
  if (e.records > 0) return e;
  ++counters.cache_misses;
  if (!may_gather) return e;
  ++counters.fallback_gathers;
  e.irradiance = gather(hit, normal, key, counters);
  return e;
}

RgbD PictureIrradiance::gather(const Hit& hit, const Vec3d& normal, std::uint64_t key,
                               Counters& counters) {
  if (!gatherer_) gatherer_ = std::make_unique<Gatherer>(lighting_, effects_, settings_.gather);
  return gatherer_->gather({hit.position, normal, hit.offset, key}, below_, counters).irradiance;
}

}  // namespace brume
