// Integrals of density along many rays at once, in even steps: what tables of light are filled by, and
// what gathers ask for where a light has none.
#pragma once

#include <memory>
#include <span>

#include "vdb_media/medium.h"

namespace brume {

// Immutable once built; all queries are thread-safe.
class DepthMarcher {
 public:
  static constexpr int kRays = 16;  // At once.

  // Of a volume with a grid, which must outlive it, as must the grid's pyramid. Each step of `step` world
  // units looks at the density once, in its middle, on a level with voxels no wider than `voxels`.
  DepthMarcher(const Volume& volume, const BrickPyramid& pyramid, double step, double voxels);
  ~DepthMarcher();
  DepthMarcher(DepthMarcher&&) noexcept;

  // Integrals of density from each ray's origin to its end, in density * world units; at most kRays.
  void march(std::span<const Ray> rays, std::span<const double> ends, std::span<float> integrals) const;

 private:
  struct State;
  std::unique_ptr<const State> state_;
};

}  // namespace brume
