// Light in the medium that has scattered already, as gathers and eye rays see it: moments of
// incident radiance (core/spherical_harmonics.h) between volume records.
//
// A gather asks tens of thousands of times, so moments are looked up once at the nodes of a regular
// grid and are linear between them. Cells that a surface passes through ask the records themselves:
// nothing is interpolated through a surface. Places off the grid, where a medium goes on beyond all
// surfaces, take the light of its nearest face.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/math.h"
#include "core/spherical_harmonics.h"
#include "gather/volume_lookup.h"

namespace brume {

// Frozen once built; read from any thread.
class IncidentField {
 public:
  // World must outlive it. Node distance follows the records' radii, within a bound on memory
  // (kMostBytes). Costs a lookup a node.
  IncidentField(const World& world, std::shared_ptr<const VolumeCache> cache, int threads);

  // Whose moments these are.
  const std::shared_ptr<const VolumeCache>& records() const { return records_; }

  int order() const { return order_; }

  // sum of weights[k] * moment k at p, and the same of a phase function's weights, which is never
  // negative however few moments there are.
  RgbD dot_signed(const Vec3d& p, std::span<const double> weights) const;
  RgbD dot(const Vec3d& p, std::span<const double> weights) const;
  RgbD moment(const Vec3d& p, int k) const;

 private:
  struct Place {
    std::size_t cell;
    std::array<int, 3> at;
    std::array<float, 3> part;
  };
  // harmonic_count(order) times three channels, channels together.
  std::size_t stride() const { return 3 * harmonic_count(order_); }
  void choose_grid(const World& world, const VolumeCache& cache);
  void mark_surfaces(const World& world);
  void fill(const World& world, int threads);
  // Nothing where the records have to be asked.
  bool find(const Vec3d& p, Place& place) const;
  std::size_t node(int x, int y, int z) const {
    return x + std::size_t(size_[0]) * (y + std::size_t(size_[1]) * z);
  }
  Vec3d node_position(int x, int y, int z) const {
    return box_.min + Vec3d(x * step_, y * step_, z * step_);
  }

  static constexpr std::size_t kMostBytes = std::size_t(192) << 20;
  std::shared_ptr<const VolumeCache> records_;
  VolumeLookup lookup_;
  int order_;
  Box3d box_;
  std::array<int, 3> size_{0, 0, 0};  // Nodes; none of them: all is asked of the records.
  double step_ = 1;
  std::vector<std::uint8_t> is_direct_;  // By cell, in the numbering of its lowest node.
  std::vector<float> moments_;
};

// Weights that turn moments into what one volume scatters back along rays from the point they
// belong to: g^l Y_lm(w) / (4 pi), w the rays' direction.
inline void phase_weights(double g, int order, const Harmonics& at_w, Harmonics& weights) {
  double factor = 0.25 * kInvPi;
  for (int l = 0; l <= order; ++l, factor *= g)
    for (int k = l * l; k < (l + 1) * (l + 1); ++k) weights[k] = factor * at_w[k];
}

}  // namespace brume
