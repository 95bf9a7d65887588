// Fluence in the medium and its gradient, against sums that share no code with the gather.
#include "gather/volume_gather.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "core/sampling.h"
#include "support/oracle.h"
#include "support/smoky_rooms.h"

namespace brume {
namespace {

// Optical depth between two points, by midpoints.
RgbD depth(const Medium& medium, const Vec3d& a, const Vec3d& b) {
  constexpr int kSteps = 32;
  RgbD sum;
  for (int i = 0; i < kSteps; ++i) sum += medium.sigma_t_at(a + (b - a) * ((i + 0.5) / kSteps));
  return sum * ((b - a).length() / kSteps);
}

// Fluence at p of light that scattered once: a direction, a distance and places on lights a sample.
double single_scattered_fluence(const World& world, const Vec3d& p, int samples) {
  double sum = 0;
  RandomStream random(77);
  for (int i = 0; i < samples; ++i) {
    const Ray ray{p, sample_sphere(random.uniform2())};
    const double end = std::min(world.tracer().intersect(ray).t, 2 * world.diagonal());
    const Vec3d q = ray.at(random.uniform() * end);
    RgbD source;
    for (const Volume& v : world.medium().volumes()) {
      const RgbD scatters = v.sigma_s_at(q) * v.density_at(q);
      if (is_black(scatters)) continue;
      for (const auto& light : world.lights()) {
        const LightSample s = light->sample(q, random.uniform2());
        if (is_black(s.weight) || world.tracer().is_occluded(shadow_ray(q, s))) continue;
        source += scatters * s.weight * v.phase.eval(-s.direction, -ray.direction) *
                  exp_neg(depth(world.medium(), q, q + s.direction * s.distance));
      }
    }
    sum += luminance(source * exp_neg(depth(world.medium(), p, q))) * end;
  }
  return 4 * kPi * sum / samples;
}

TEST(VolumeGather, FluenceOfLightThatScatteredOnceIsThatOfPlainSampling) {
  Scene scene = test::smoky_room();
  const test::LitWorld lit(scene);
  VolumeGatherer gatherer(lit.lighting, lit.effects, {}, 0);
  for (const Vec3d& p : {Vec3d(0.5, 0.7, 0.5), Vec3d(0.5, 0.4, 0.3), Vec3d(0.3, 0.6, 0.7)}) {
    double mean = 0;
    constexpr int kSeeds = 16;
    for (int s = 0; s < kSeeds; ++s) {
      Counters counters;
      mean += luminance(gatherer.gather(p, random_key(3, s), HitLight{.reflect = false}, counters)
                            .moments[0]) /
              kSeeds;
    }
    const double truth = single_scattered_fluence(lit.world, p, 100000);
    EXPECT_NEAR(mean / truth, 1, 0.015) << p;
  }
}

}  // namespace
}  // namespace brume
