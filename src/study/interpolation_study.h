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

// One set of records, all modes. relMSE, the reference's noise taken off.
struct InterpolationErrors {
  std::size_t records = 0;
  int points = 0;  // Compared; the others had no record.
  std::array<double, kModeCount> relmse{};
  // Over the mean: not ruled by the darkest points, as relMSE can be where the reference is noisy
  // there.
  std::array<double, kModeCount> relative_rms{};
};

struct InterpolationStudy {
  InterpolationErrors as_baked;
  // A random quarter of the records with twice the radii: about what a bake of twice the error
  // would leave, where it is gradients that matter and less the noise of the records.
  InterpolationErrors sparse;
  double media_share = 0;      // Of the irradiance at the points, mean.
  double reference_noise = 0;  // Standard error of the reference, rms over its mean.
};

// `caches` hold the records of a bake of this view in every mode (regradient.h); `cache` is that
// bake, whose deeper layers light the reference gathers too.
InterpolationStudy study_interpolation(const StudyScene& scene, const IrradianceCache& cache,
                                       const RegradientResult& caches,
                                       const InterpolationOptions& options, const StudyRun& run);

}  // namespace brume
