// Smoke and dust that look like it: noise, so their integrals are known only to quadrature.
#pragma once

#include <cstdint>

#include "core/math.h"

namespace brume {

// A plume that rises from `source` along +y, widens, curls, and spreads below a ceiling at
// source.y + height. Between 0 and about 1.
struct SmokePlume {
  Vec3d source{0.0};
  double height = 2;
  double source_radius = 0.12, top_radius = 0.45;
  double curl = 0.3;  // How far the flow has carried the smoke at the top, in heights.
  double detail = 1;  // How deeply fine noise bites into the smoke; 0: a smooth column.
  Box3d fade_box;     // Density falls to 0 over `fade_width` inside its faces; empty: no fade.
  double fade_width = 0.08;
  std::uint64_t seed = 1;
};

// Haze with soft clouds in it, thicker towards the ground. Its mean at the ground is about
// `density`.
struct Dust {
  double density = 1, scale_height = 1, ground = 0;
  double feature_size = 0.3;  // Of the largest clouds.
  double contrast = 0.7;      // 0: an even haze; 1: clear air between the clouds.
  std::uint64_t seed = 1;
};

double plume_density(const SmokePlume& plume, const Vec3d& p);
double dust_density(const Dust& dust, const Vec3d& p);

}  // namespace brume
