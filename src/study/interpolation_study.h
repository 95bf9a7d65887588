// What interpolating with each kind of gradient gives at points of a view, from the same records.
#pragma once

#include <array>
#include <string>

#include "study/regradient.h"

namespace brume {

struct InterpolationOptions {
  BakeView view;
  int points = 1000;         // At most; middles of pixels, on a lattice over the view.
  int least_stride = 8;      // Of that lattice, in pixels.
  int reference_cells = 32;  // Theta strips of each of the two gathers a point is compared with.
  std::uint64_t seed = 1;
};

struct InterpolationStudy {
  std::size_t records = 0;
  int points = 0;                           // Compared; the others had no record.
  double media_share = 0;                   // Of the irradiance at the points, mean.
  double reference_noise = 0;               // Standard error of the reference, rms over its mean.
  std::array<double, kModeCount> relmse{};  // The reference's noise is taken off.
};

// `caches` hold the records of a bake of this view in every mode (regradient.h); `cache` is that
// bake, whose deeper layers light the reference gathers too.
InterpolationStudy study_interpolation(const StudyScene& scene, const IrradianceCache& cache,
                                       const RegradientResult& caches,
                                       const InterpolationOptions& options, const StudyRun& run);

}  // namespace brume
