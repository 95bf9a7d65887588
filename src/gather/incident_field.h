// Light in the medium that has scattered already, as gathers see it: moments of incident radiance
// (core/spherical_harmonics.h) on a regular grid, linear between its nodes. Built of the volume
// records of one bounce (bake/), because a gather asks tens of thousands of times.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/math.h"
#include "core/spherical_harmonics.h"

namespace brume {

// Plain data once filled; read from any thread.
class IncidentField {
 public:
  // Where a point lies among the nodes. Points outside the box are moved to its nearest face.
  struct Corners {
    std::array<std::uint32_t, 8> node;
    std::array<float, 8> weight;
  };

  // `box` is finite and not empty; nodes are `spacing` apart, or closer so that some lie on each
  // face, and at most `max_nodes` in all.
  IncidentField(const Box3d& box, double spacing, int order, std::size_t max_nodes);

  int order() const { return order_; }
  const Box3d& box() const { return box_; }
  std::size_t node_count() const { return std::size_t(size_[0]) * size_[1] * size_[2]; }
  Vec3d node_position(std::size_t node) const;
  double spacing() const { return std::max({step_.x, step_.y, step_.z}); }
  Corners corners(const Vec3d& p) const;

  // harmonic_count(order) times three channels, channels together.
  std::size_t stride() const { return 3 * harmonic_count(order_); }
  std::span<float> moments(std::size_t node) { return {&moments_[node * stride()], stride()}; }
  std::span<const float> moments(std::size_t node) const {
    return {&moments_[node * stride()], stride()};
  }

  // sum of weights[k] * moment k at p, and the same of a phase function's weights, which is never
  // negative however few moments there are.
  RgbD dot_signed(const Vec3d& p, std::span<const double> weights) const;
  RgbD dot(const Vec3d& p, std::span<const double> weights) const;
  RgbD moment(const Vec3d& p, int k) const;

 private:
  Box3d box_;
  int order_;
  std::array<int, 3> size_;
  Vec3d step_{0.0};
  std::vector<float> moments_;
};

// Weights that turn moments into what one volume scatters back along rays from the point they belong
// to: g^l Y_lm(w) / (4 pi), w the rays' direction.
inline void phase_weights(double g, int order, const Harmonics& at_w, Harmonics& weights) {
  double factor = 0.25 * kInvPi;
  for (int l = 0; l <= order; ++l, factor *= g)
    for (int k = l * l; k < (l + 1) * (l + 1); ++k) weights[k] = factor * at_w[k];
}

}  // namespace brume
