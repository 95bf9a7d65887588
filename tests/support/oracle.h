// Gathers at a receiver of the reference scenes, many seeds at a time.
#pragma once

#include <memory>
#include <vector>

#include "data_gen/oracle_scenes.h"
#include "gather/gather.h"

namespace brume::test {

// A world with its lighting and effects, built once.
struct LitWorld {
  explicit LitWorld(const Scene& scene, LightDepth depth = LightDepth::Exact)
      : world(scene), lighting(world, {.depth = depth}), effects(plan_effects(world, 1, 1)) {}
  World world;
  Lighting lighting;
  Effects effects;
};

inline OracleScene scene_of(const OracleCase& oracle) {
  return oracle.scene == "glossy" ? glossy_oracle_scene() : oracle_scene(oracle.scene, 0.05);
}

struct GradientStatistics {
  double mean_irradiance = 0;
  Vec3d mean_gradient{0.0};
  double rms_tangential = 0;  // Of the gradient's x and y against the truth, relative to it.
  double rms_normal = 0;
};

inline GradientStatistics gather_seeds(const LitWorld& lit, const OracleCase& oracle,
                                       const GatherOptions& options, int seeds) {
  Gatherer gatherer(lit.lighting, lit.effects, options);
  GradientStatistics out;
  double tangential = 0, normal = 0;
  for (int s = 0; s < seeds; ++s) {
    Counters counters;
    const GatherPoint point{oracle.position, Vec3d(0, 0, 1), 0, random_key(17, s)};
    const GatherResult g = gatherer.gather(point, HitLight{.reflect = false}, counters);
    const Vec3d gradient = g.terms.sum().g, error = gradient - oracle.gradient;
    out.mean_irradiance += g.irradiance.g / seeds;
    out.mean_gradient += gradient / seeds;
    tangential += (error.x * error.x + error.y * error.y) / seeds;
    normal += error.z * error.z / seeds;
  }
  const Vec3d& truth = oracle.gradient;
  out.rms_tangential = std::sqrt(tangential / (truth.x * truth.x + truth.y * truth.y));
  if (oracle.has_normal_gradient) out.rms_normal = std::sqrt(normal) / std::abs(truth.z);
  return out;
}

}  // namespace brume::test
