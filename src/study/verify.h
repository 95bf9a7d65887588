// How far a cache's answers are from brute force, at points it was not baked at.
#pragma once

#include <cstdint>
#include <vector>

#include "bake/bake.h"

namespace brume {

struct VerifyOptions {
  int points = 64;
  int cells_theta = 64, cells_phi = 201;  // Of the brute-force gathers.
  std::uint64_t seed = 1;
  int worst_points = 5;  // How many of Verification::worst.
  int threads = 0;
};

struct VerifyPoint {
  Vec3d position{0.0}, normal{0.0};
  double cached = 0, reference = 0;  // Luminance of irradiance.
  double relative_error() const;     // Over the reference, floored at 1 % of the mean reference.
  double floor = 0;
};

// Relative numbers: bias is the mean of (cached - reference) over the mean reference.
struct Verification {
  int points = 0, uncovered = 0;
  double bias = 0, rmse = 0, p95 = 0;
  std::vector<VerifyPoint> worst;  // By size of the relative error, the largest first.
  double seconds = 0;
};

// Points are drawn near records of the top layer, stratified over them: each is moved inside its record's
// radius along the surface and dropped back on it.
Verification verify_cache(const Lighting& lighting, const BakeSettings& settings,
                          const IrradianceCache& cache, const VerifyOptions& options);

}  // namespace brume
