// The same records with other gradients: what comparing gradients needs, and what they cost.
#pragma once

#include <array>

#include "study/study_scene.h"

namespace brume {

// Gathers each top-layer record of `cache`, baked from this scene with these settings, once more
// and gives it the gradients of every mode (kGradientModes' order). Keys, positions, radii and
// irradiance stay as they are; records of deeper layers are left out. `largest_change` is the
// largest relative difference between the irradiance stored and the one gathered now: 0 for records
// of this program's own.
struct RegradientResult {
  std::array<IrradianceCache, kModeCount> caches;
  double largest_change = 0;
};
RegradientResult regradient(const StudyScene& scene, const IrradianceCache& cache,
                            const StudyRun& run);

// CPU time of one mode's gathers over another's at the same records, in pairs: the records are cut
// into `pairs` blocks, each gathered in both modes, and the order alternates. On one thread.
struct PairedCost {
  double ratio = 1;          // Median over pairs.
  double low = 1, high = 1;  // Interval of the median; 96.5 % for 15 pairs.
  int pairs = 0;
  std::size_t gathers = 0;             // In each mode.
  double ms_first = 0, ms_second = 0;  // CPU milliseconds a gather, mean.
};
inline constexpr int kCostPairs = 15;
PairedCost compare_gather_cost(const StudyScene& scene, const IrradianceCache& cache,
                               GradientMode first, GradientMode second, std::size_t gathers,
                               const StudyRun& run);

}  // namespace brume
