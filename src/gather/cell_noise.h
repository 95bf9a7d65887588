// How far off a sum over cells may be, from how far each cell's sample is from what its neighbours
// lead to expect.
#pragma once

#include <span>
#include <vector>

#include "gather/direction_cells.h"

namespace brume {

// Neighbours by cell. Immutable, shared by threads.
class CellNoise {
 public:
  explicit CellNoise(const DirectionCells& cells);

  // Estimated variance of the sum of measure * value over all cells, of one sample each at a unit
  // `direction`: what a plane through a cell and its neighbours, fitted by least squares, leaves of
  // the cell's value. What changes smoothly does not count, since samples on a lattice add it up
  // almost exactly.
  double variance(const DirectionCells& cells, std::span<const Vec3d> directions,
                  std::span<const double> values) const;

 private:
  std::vector<int> begin_, neighbours_;
};

}  // namespace brume
