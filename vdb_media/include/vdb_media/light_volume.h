// Optical depth from one light to every point of one volume, tabulated (DESIGN 4.4): smooth, so it is
// stored coarsely and read back trilinearly; visibility is not in it.
#pragma once

#include <memory>
#include <variant>

#include "core/math.h"
#include "vdb_media/brick_grid.h"
#include "vdb_media/medium.h"
#include "vdb_media/ray_marcher.h"

namespace brume {

struct PointOrigin {
  Vec3d position{0.0};
};
struct DirectionOrigin {
  Vec3d direction{0.0, 0.0, -1.0};  // The way the light travels; unit length.
};
using LightOrigin = std::variant<PointOrigin, DirectionOrigin>;

struct LightVolumeOptions {
  double target_error = 0.005;  // Of transmittance, rms over stratified points.
  int threads = 0;
  std::uint64_t max_bytes = 256ull << 20;
  const BrickPyramid* pyramid = nullptr;  // Of the volume's density; null: made for this one.
};

// Immutable, shared by all threads. Built for the grid `volume`; the region it covers is the box of
// the grid's density, outside which a point's depth is found by entering the box (points past it, as
// seen from the light, by marching).
class LightVolume {
 public:
  // Starts coarse (a quarter of the grid's resolution) and doubles until `target_error` is met at
  // test points off the lattice, or voxel resolution or max_bytes is reached. Nodes are marched in
  // steps of half their distance, sixteen at once; those as fine as voxels cell by cell.
  LightVolume(const Volume& volume, const LightOrigin& origin, const LightVolumeOptions& options);

  // Integral of the volume's density between the light and p (inside the covered box). ~20 ns.
  double density_integral(const Vec3d& p) const;
  bool covers(const Vec3d& p) const;

  // Measured at stratified points off the lattice, of exp(-sigma_t integral).
  double rms_error() const { return rms_error_; }
  double max_error() const { return max_error_; }
  std::size_t memory_bytes() const { return values_.size() * sizeof(float); }

 private:
  Box3d box_index_;  // In the grid's index space.
  Affine3d world_to_index_;
  Vec3i count_;
  Vec3d nodes_per_index_;
  std::vector<float> values_;
  double rms_error_ = 0, max_error_ = 0;
};

}  // namespace brume
