#include "scene/spherical_rectangle.h"

namespace brume {
namespace {

double safe_acos(double x) { return std::acos(std::clamp(x, -1.0, 1.0)); }

}  // namespace

SphericalRectangle::SphericalRectangle(const Vec3d& corner, const Vec3d& edge_u,
                                       const Vec3d& edge_v, const Vec3d& from)
    : origin_(from), k_(0), solid_angle_(0) {
  const double length_u = edge_u.length(), length_v = edge_v.length();
  x_ = edge_u / length_u;
  y_ = edge_v / length_v;
  z_ = x_.cross(y_);
  const Vec3d d = corner - from;
  z0_ = d.dot(z_);
  if (z0_ > 0) {
    z_ = -z_;
    z0_ = -z0_;
  }
  x0_ = d.dot(x_), x1_ = x0_ + length_u;
  y0_ = d.dot(y_), y1_ = y0_ + length_v;
  b0_ = b1_ = 0;
  if (!(z0_ < 0)) return;
  // z components of the normals of the four planes through an edge and the point.
  const auto normal_z = [&](double a) { return -a / std::sqrt(z0_ * z0_ + a * a); };
  const double n0z = normal_z(y0_), n1z = -normal_z(x1_), n2z = -normal_z(y1_), n3z = normal_z(x0_);
  const double g0 = safe_acos(-n0z * n1z), g1 = safe_acos(-n1z * n2z), g2 = safe_acos(-n2z * n3z),
               g3 = safe_acos(-n3z * n0z);
  b0_ = n0z;
  b1_ = n2z;
  k_ = 2 * kPi - g2 - g3;
  solid_angle_ = std::max(0.0, g0 + g1 - k_);
}

Vec3d SphericalRectangle::sample(const Vec2d& u) const {
  const double a = u.x * solid_angle_ + k_, f = (std::cos(a) * b0_ - b1_) / std::sin(a);
  const double c = std::clamp(std::copysign(1.0, f) / std::sqrt(f * f + b0_ * b0_), -1.0, 1.0);
  const double x = std::clamp(-(c * z0_) / std::sqrt(std::max(1e-300, 1 - c * c)), x0_, x1_);
  const double d2 = x * x + z0_ * z0_, d = std::sqrt(d2);
  const double h0 = y0_ / std::sqrt(d2 + y0_ * y0_), h1 = y1_ / std::sqrt(d2 + y1_ * y1_);
  const double h = h0 + u.y * (h1 - h0), h2 = h * h;
  const double y = h2 < 1 ? std::clamp(h * d / std::sqrt(1 - h2), y0_, y1_) : y1_;
  return origin_ + x_ * x + y_ * y + z_ * z0_;
}

}  // namespace brume
