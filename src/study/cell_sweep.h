// How irradiance and its gradients at one point settle as the cells of a gather grow.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "gather/gather.h"

namespace brume {

// Means and errors over seeds, of luminance. Errors are relative, against the mean of the sweep's
// last row: its irradiance, and its gradient in mode full (0 where those are 0).
struct CellSweepRow {
  int cells_theta = 0, cells_phi = 0;
  RgbD irradiance;
  double irradiance_rms = 0;
  std::array<Vec3d, kGradientModes.size()> gradient;         // [W/m^2 per world unit], by mode.
  std::array<double, kGradientModes.size()> gradient_rms{};  // By mode.
  double seconds = 0;                                        // CPU time of one gather in mode full.

  const Vec3d& gradient_of(GradientMode mode) const { return gradient[static_cast<int>(mode)]; }
  double rms_of(GradientMode mode) const { return gradient_rms[static_cast<int>(mode)]; }
};

// From 4x13 to 128x402 cells, one gather a key and row; all modes from the same samples. `options`
// give the shells. The last row costs a thousand times the first; with mode media, seconds a key in
// smoke.
std::vector<CellSweepRow> sweep_cells(const Lighting& lighting, const Effects& effects,
                                      const GatherPoint& at, const HitLight& below,
                                      const GatherOptions& options,
                                      std::span<const std::uint64_t> keys);

}  // namespace brume
