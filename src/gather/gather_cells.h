// The hemisphere cut into M x N cells of equal cosine-weighted area, and the exact moments of its cells and
// walls (gradients.md 1). Directions are in the local frame of the receiver: z is the normal.
#pragma once

#include <vector>

#include "core/math.h"

namespace brume {

class HemisphereCells {
 public:
  HemisphereCells() = default;
  // Azimuth 0 is turned by phi0. O(M + N).
  HemisphereCells(int cells_theta, int cells_phi, double phi0);

  int theta_count() const { return m_; }
  int phi_count() const { return n_; }
  int count() const { return m_ * n_; }
  int index(int j, int k) const { return j * n_ + k; }

  // A direction in cell (j, k), uniform in its cosine-weighted area for u in [0,1)^2.
  Vec3d direction(int j, int k, const Vec2d& u) const;

  // G = int cos dw; all cells have the same.
  double cosine_measure() const { return kPi / count(); }
  // W = int w cos dw.
  Vec3d direction_moment(int j, int k) const;
  // R = int (n x w) dw.
  Vec3d rotation_moment(int j, int k) const;

  // Theta wall j, between cells (j-1, k) and (j, k), 1 <= j < M: B and the direction of its middle.
  Vec3d theta_wall(int j, int k) const;
  Vec3d theta_wall_direction(int j, int k) const;
  // Phi wall k, between cells (j, k-1) and (j, k).
  Vec3d phi_wall(int j, int k) const;
  Vec3d phi_wall_direction(int j, int k) const;

 private:
  int m_ = 0, n_ = 0;
  double phi0_ = 0, dphi_ = 0, chord_ = 0;  // chord = 2 sin(dphi / 2).
  std::vector<double> s_, c_, theta_sc_;    // sin, cos, theta - sin cos of the theta walls.
  std::vector<Vec2d> centre_, wall_;        // Azimuth directions of cell centres and phi walls.
};

}  // namespace brume
