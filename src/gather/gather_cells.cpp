#include "gather/gather_cells.h"

namespace brume {

HemisphereCells::HemisphereCells(int cells_theta, int cells_phi, double phi0)
    : m_(cells_theta), n_(cells_phi), phi0_(phi0), dphi_(2 * kPi / cells_phi),
      chord_(2 * std::sin(dphi_ / 2)) {
  for (int j = 0; j <= m_; ++j) {
    const double s = std::sqrt(double(j) / m_), c = std::sqrt(double(m_ - j) / m_);
    s_.push_back(s);
    c_.push_back(c);
    theta_sc_.push_back(std::atan2(s, c) - s * c);
  }
  for (int k = 0; k < n_; ++k) {
    const double wall = phi0 + k * dphi_, centre = wall + dphi_ / 2;
    wall_.emplace_back(std::cos(wall), std::sin(wall));
    centre_.emplace_back(std::cos(centre), std::sin(centre));
  }
}

Vec3d HemisphereCells::direction(int j, int k, const Vec2d& u) const {
  const double s2 = (j + u.x) / m_, s = std::sqrt(s2), phi = phi0_ + (k + u.y) * dphi_;
  return {s * std::cos(phi), s * std::sin(phi), std::sqrt(std::max(0.0, 1 - s2))};
}

Vec3d HemisphereCells::direction_moment(int j, int k) const {
  const double s0 = s_[j], s1 = s_[j + 1], c0 = c_[j], c1 = c_[j + 1];
  const double a = chord_ * (s1 * s1 * s1 - s0 * s0 * s0) / 3;
  return {a * centre_[k].x, a * centre_[k].y, dphi_ * (c0 * c0 * c0 - c1 * c1 * c1) / 3};
}

Vec3d HemisphereCells::rotation_moment(int j, int k) const {
  const double a = chord_ / 2 * (theta_sc_[j + 1] - theta_sc_[j]);
  return {-centre_[k].y * a, centre_[k].x * a, 0};  // v = n x u.
}

Vec3d HemisphereCells::theta_wall(int j, int k) const {
  const double a = chord_ * s_[j] * c_[j] * c_[j];
  return {a * centre_[k].x, a * centre_[k].y, -dphi_ * s_[j] * s_[j] * c_[j]};
}

Vec3d HemisphereCells::theta_wall_direction(int j, int k) const {
  return {s_[j] * centre_[k].x, s_[j] * centre_[k].y, c_[j]};
}

Vec3d HemisphereCells::phi_wall(int j, int k) const {
  const double a = s_[j + 1] - s_[j];
  return {-wall_[k].y * a, wall_[k].x * a, 0};
}

Vec3d HemisphereCells::phi_wall_direction(int j, int k) const {
  const double s2 = (j + 0.5) / m_, s = std::sqrt(s2);
  return {s * wall_[k].x, s * wall_[k].y, std::sqrt(1 - s2)};
}

}  // namespace brume
