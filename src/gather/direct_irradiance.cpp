#include "core/random.h"
#include "gather/gather.h"

namespace brume {

RgbD direct_irradiance(const Lighting& lighting, const Vec3d& position, const Vec3d& normal,
                       int samples, std::uint64_t key, Counters& counters) {
  const World& world = lighting.world();
  RandomStream random(key);
  RgbD sum;
  for (std::size_t l = 0; l < world.lights().size(); ++l) {
    const Light& light = *world.lights()[l];
    const int n = light.is_delta() ? 1 : samples;
    for (int i = 0; i < n; ++i) {
      const LightSample s = light.sample(position, random.uniform2());
      const double cosine = normal.dot(s.direction);
      if (cosine <= 0 || is_black(s.weight)) continue;
      ++counters.shadow_rays;
      if (world.tracer().is_occluded(shadow_ray(position, s))) continue;
      sum += s.weight * lighting.exact_transmittance(s, position, counters) * (cosine / n);
    }
  }
  return sum;
}

}  // namespace brume
