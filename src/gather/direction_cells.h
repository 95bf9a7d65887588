// The hemisphere cut into cells and the walls between them, with the exact moments that irradiance
// and its gradients are sums of (gradients.md 1 and 3). Directions are in the local frame of the
// receiver: z is the normal. Turn the frame, not the cells, for a random rotation.
//
// Cells lie in rings around the normal and all have the same cosine-weighted area. They are about
// square near the normal and wide near the horizon (docs/decisions/0004), so neighbouring rings
// differ in their numbers of cells, and the arc between two rings is cut into walls wherever either
// ring is.
#pragma once

#include <span>
#include <vector>

#include "core/math.h"

namespace brume {

struct DirectionCell {
  double measure = 0;    // G = int cos dw.
  Vec3d direction{0.0};  // W = int w cos dw.
  Vec3d rotation{0.0};   // R = int (n x w) dw.
  // The sides of walls around the cell, [first_side, end_side). The horizon needs no walls.
  int first_side = 0, end_side = 0;
};

struct CellWall {
  int low = 0, high = 0;            // The cells it lies between.
  int low_side = 0, high_side = 0;  // Its two sides, numbered cell by cell.
  Vec3d moment{0.0};                // B = int cos (w x dw), pointing from low to high.
  Vec3d middle{0.0};                // The direction of its middle.
};

// Immutable, shared by threads.
class DirectionCells {
 public:
  // `count` cells, at least 1. O(count).
  explicit DirectionCells(int count);

  int count() const { return static_cast<int>(cells_.size()); }
  int side_count() const { return static_cast<int>(2 * walls_.size()); }
  const DirectionCell& cell(int c) const { return cells_[c]; }
  std::span<const CellWall> walls() const { return walls_; }

  // A direction in cell c. For a `shift` that is uniform in [0,1)^2 it is uniform in the cell's
  // cosine-weighted area; one shift for all cells spreads them like the points of a lattice
  // [Rob18].
  Vec3d direction(int c, const Vec2d& shift) const;

 private:
  struct Ring {
    int first, count;
    double s2_begin, s2_end;  // sin^2 theta.
  };
  void add_cells();
  void add_walls_within(const Ring& ring);
  void add_walls_between(const Ring& inner, const Ring& outer);
  void number_sides();

  std::vector<Ring> rings_;
  std::vector<int> ring_of_;  // By cell.
  std::vector<DirectionCell> cells_;
  std::vector<CellWall> walls_;
};

}  // namespace brume
