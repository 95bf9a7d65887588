#include "gather/incident_field.h"

#include <algorithm>

namespace brume {

IncidentField::IncidentField(const Box3d& box, double spacing, int order, std::size_t max_nodes)
    : box_(box), order_(order) {
  const Vec3d extent = box.max - box.min;
  for (;; spacing *= 1.1) {
    for (int a = 0; a < 3; ++a)
      size_[a] = 2 + static_cast<int>(std::min(1e6, std::floor(extent[a] / spacing)));
    if (double(size_[0]) * size_[1] * size_[2] <= double(std::max<std::size_t>(8, max_nodes))) break;
  }
  for (int a = 0; a < 3; ++a) step_[a] = extent[a] / (size_[a] - 1);
  moments_.assign(node_count() * stride(), 0);
}

Vec3d IncidentField::node_position(std::size_t node) const {
  const auto x = static_cast<int>(node % size_[0]), y = static_cast<int>(node / size_[0] % size_[1]),
             z = static_cast<int>(node / size_[0] / size_[1]);
  return box_.min + Vec3d(x * step_.x, y * step_.y, z * step_.z);
}

IncidentField::Corners IncidentField::corners(const Vec3d& p) const {
  std::array<std::uint32_t, 3> cell;
  std::array<float, 3> f;
  for (int a = 0; a < 3; ++a) {
    const double at = std::clamp(step_[a] > 0 ? (p[a] - box_.min[a]) / step_[a] : 0.0, 0.0,
                                 double(size_[a] - 1));
    cell[a] = static_cast<std::uint32_t>(std::min(at, double(size_[a] - 2)));
    f[a] = static_cast<float>(at - cell[a]);
  }
  Corners corners;
  for (std::uint32_t i = 0; i < 8; ++i) {
    const std::uint32_t x = i & 1, y = i >> 1 & 1, z = i >> 2;
    corners.node[i] = cell[0] + x + size_[0] * (cell[1] + y + size_[1] * (cell[2] + z));
    corners.weight[i] =
        (x ? f[0] : 1 - f[0]) * (y ? f[1] : 1 - f[1]) * (z ? f[2] : 1 - f[2]);
  }
  return corners;
}

RgbD IncidentField::dot_signed(const Vec3d& p, std::span<const double> weights) const {
  const Corners at = corners(p);
  RgbD sum;
  for (std::size_t i = 0; i < 8; ++i) {
    const float* m = &moments_[at.node[i] * stride()];
    RgbD here;
    for (std::size_t k = 0; k < weights.size(); ++k)
      here += RgbD(m[3 * k], m[3 * k + 1], m[3 * k + 2]) * weights[k];
    sum += here * at.weight[i];
  }
  return sum;
}

RgbD IncidentField::dot(const Vec3d& p, std::span<const double> weights) const {
  RgbD sum = dot_signed(p, weights);
  for (int c = 0; c < 3; ++c) sum[c] = std::max(0.0, sum[c]);
  return sum;
}

RgbD IncidentField::moment(const Vec3d& p, int k) const {
  const Corners at = corners(p);
  RgbD sum;
  for (std::size_t i = 0; i < 8; ++i) {
    const float* m = &moments_[at.node[i] * stride() + 3 * k];
    sum += RgbD(m[0], m[1], m[2]) * at.weight[i];
  }
  return sum;
}

}  // namespace brume
