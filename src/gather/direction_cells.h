// The directions around a receiver cut into cells and the walls between them, with the exact moments
// that irradiance or fluence and their gradients are sums of (gradients.md 1, 3 and 11). Directions
// are in the local frame of the receiver: z is the normal of a surface. Turn the frame, not the
// cells, for a random rotation.
//
// A surface receives from a hemisphere, weighted with the cosine; a point of the medium from the
// whole sphere, evenly: `weight` below is cos or 1. Cells lie in rings around z and all have the same
// weighted area. Those of a sphere are about square, those of a hemisphere are so near the normal and
// wide near the horizon (docs/decisions/0004); neighbouring rings differ in their numbers of cells,
// and the arc between two rings is cut into walls wherever either ring is.
#pragma once

#include <span>
#include <vector>

#include "core/math.h"

namespace brume {

enum class DirectionDomain { Hemisphere, Sphere };

struct DirectionCell {
  double measure = 0;    // G = int weight dw.
  Vec3d direction{0.0};  // W = int w weight dw.
  Vec3d rotation{0.0};   // R = int (n x w) dw; of hemispheres only.
  // The sides of walls around the cell, [first_side, end_side). The horizon needs no walls.
  int first_side = 0, end_side = 0;
};

struct CellWall {
  int low = 0, high = 0;            // The cells it lies between.
  int low_side = 0, high_side = 0;  // Its two sides, numbered cell by cell.
  Vec3d moment{0.0};                // B = int weight (w x dw), pointing from low to high.
  Vec3d middle{0.0};                // The direction of its middle.
};

// Immutable, shared by threads.
class DirectionCells {
 public:
  // `count` cells, at least 1 in a hemisphere and 6 in a sphere (fewer give so many). O(count).
  explicit DirectionCells(int count, DirectionDomain domain = DirectionDomain::Hemisphere);

  // pi or 4 pi.
  double measure() const { return domain_ == DirectionDomain::Sphere ? 4 * kPi : kPi; }
  int count() const { return static_cast<int>(cells_.size()); }
  // Half the width of a cell [rad]: what a ray stands for, at each unit of its length.
  double spread() const { return 0.5 * std::sqrt(measure() / count()); }
  DirectionDomain domain() const { return domain_; }
  int side_count() const { return static_cast<int>(2 * walls_.size()); }
  const DirectionCell& cell(int c) const { return cells_[c]; }
  std::span<const CellWall> walls() const { return walls_; }

  // A direction in cell c. For a `shift` that is uniform in [0,1)^2 it is uniform in the cell's
  // weighted area; one shift for all cells spreads them like the points of a lattice
  // [Rob18].
  Vec3d direction(int c, const Vec2d& shift) const;
  // The cell that a unit direction lies in; below 0 for one under the horizon of a hemisphere.
  int cell_at(const Vec3d& direction) const;

 private:
  struct Ring {
    int first, count;
    double begin, end;  // Part of the whole measure that lies closer to z.
  };
  // theta where that part of the measure lies closer to z.
  struct Latitude {
    double sine, cosine;
  };
  Latitude latitude(double part) const;
  int cells_of_ring(double begin, int count) const;
  void add_cells();
  void add_walls_within(const Ring& ring);
  void add_walls_between(const Ring& inner, const Ring& outer);
  void number_sides();

  DirectionDomain domain_;
  std::vector<Ring> rings_;
  std::vector<int> ring_of_;  // By cell.
  std::vector<DirectionCell> cells_;
  std::vector<CellWall> walls_;
};

}  // namespace brume
