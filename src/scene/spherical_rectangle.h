// Samples a rectangle uniformly over the solid angle it covers as seen from a point [UFK13].
#pragma once

#include "core/math.h"

namespace brume {

// `edge_u` and `edge_v` are perpendicular. Made for one point; costs four arc cosines.
class SphericalRectangle {
 public:
  SphericalRectangle(const Vec3d& corner, const Vec3d& edge_u, const Vec3d& edge_v,
                     const Vec3d& from);

  // 0 from a point in the rectangle's plane.
  double solid_angle() const { return solid_angle_; }
  // A point of the rectangle.
  Vec3d sample(const Vec2d& u) const;

 private:
  Vec3d origin_, x_, y_, z_;
  double x0_, y0_, x1_, y1_, z0_, b0_, b1_, k_, solid_angle_;
};

}  // namespace brume
