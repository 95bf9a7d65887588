// How far a cache's answers are from traced paths, at points it was not baked at. Paths share
// neither records nor gathers with it, so that wrong deep records show too.
#pragma once

#include <cstdint>
#include <vector>

#include "bake/bake.h"

namespace brume {

struct VerifyOptions {
  int points = 64;
  int paths = 4096;  // At each; an even number.
  std::uint64_t seed = 1;
  int worst_points = 5;  // How many of Verification::worst.
  int threads = 0;
};

struct VerifyPoint {
  Vec3d position{0.0}, normal{0.0};
  double cached = 0, reference = 0;  // Luminance of irradiance.
  double reference_error = 0;        // Standard error of the paths' mean.
  double relative_error() const;     // Over the reference, floored at 1 % of the mean reference.
  double floor = 0;
};

// Relative numbers: bias is the mean of (cached - reference) over the mean reference. What the
// paths are off themselves is taken out of rmse by two independent halves; it is in p95 and worst.
struct Verification {
  int points = 0, uncovered = 0;
  double bias = 0, rmse = 0, p95 = 0;
  std::vector<VerifyPoint> worst;  // By size of the relative error, the largest first.
  double seconds = 0;
};

// Points are drawn near records of the top layer, stratified over them: each is moved inside its
// record's radius along the surface and dropped back on it.
Verification verify_cache(const Lighting& lighting, const BakeSettings& settings,
                          const IrradianceCache& cache, const VerifyOptions& options);

}  // namespace brume
