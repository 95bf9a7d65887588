// What fills space: any number of overlapping volumes, each with its own coefficients, phase function
// and emission. Their extinctions add up.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "core/math.h"
#include "vdb_media/brick_grid.h"
#include "vdb_media/brick_pyramid.h"
#include "vdb_media/phase_function.h"

namespace brume {

// Planck radiance at `kelvin` in linear Rec.709 [W/(m^2 sr)], each channel the band-integrated
// radiance seen through CIE 1931 observers normalised so that luminance is that of the spectrum over
// 380..780 nm. 0 at and below 0 K; monotone in temperature.
Rgb blackbody_radiance(double kelvin);

// Light that a volume gives off by itself, per length [W/(m^3 sr)].
struct Emission {
  enum class Mode { None, Density, Grid, Blackbody };
  Mode mode = Mode::None;
  // Density: scale*color*sigma_t; Grid: scale*color*grid; Blackbody: scale*sigma_a*B(temperature_scale*T).
  double scale = 1, temperature_scale = 1;
  Rgb color{1.0f};
  // Grid: one channel or three; Blackbody: the temperature, one channel.
  std::vector<std::shared_ptr<const BrickGrid>> grid;
};

// One volume. Plain data, immutable once in a Medium.
struct Volume {
  std::string name;
  // Nothing for a homogeneous volume, whose density is 1 inside `bounds`.
  std::shared_ptr<const BrickGrid> density;
  // Homogeneous only: world-space box, possibly infinite.
  Box3d bounds{Vec3d(-kInfinity), Vec3d(kInfinity)};
  RgbD sigma_s, sigma_a;  // Per unit density [1/world unit].
  // Colour grid multiplying sigma_s/sigma_t (extinction stays): empty, one channel or three; clamped to [0,1].
  std::vector<std::shared_ptr<const BrickGrid>> albedo_grid;
  HenyeyGreenstein phase;
  Emission emission;

  RgbD sigma_t() const { return sigma_s + sigma_a; }
  bool is_homogeneous() const { return density == nullptr; }
  bool scatters() const;      // Some density, and sigma_s.
  bool emits() const;         // Some light can come of the emission.
  bool is_chromatic() const;  // sigma_t differs between channels.
  bool is_empty() const;      // No density anywhere and no emission.
  Box3d world_bounds() const; // Of density and emission together.

  // At a world-space point. Density is the interpolant that marchers integrate.
  double density_at(const Vec3d& p) const;
  BrickGrid::ValueGradient density_gradient_at(const Vec3d& p) const;  // World-space gradient.
  // sigma_s per unit density at p (albedo grid included).
  RgbD sigma_s_at(const Vec3d& p) const;
  // Emitted radiance per length at p [W/(m^2 sr) per world unit].
  RgbD emission_at(const Vec3d& p) const;
};

// Immutable, shared by all threads.
class Medium {
 public:
  Medium() = default;
  // Empty volumes are dropped.
  explicit Medium(std::vector<Volume> volumes);

  const std::vector<Volume>& volumes() const { return volumes_; }
  bool is_vacuum() const { return volumes_.empty(); }
  bool scatters() const { return scatters_; }
  bool emits() const { return emits_; }
  bool is_chromatic() const { return chromatic_; }
  bool is_unbounded() const { return unbounded_; }
  bool is_heterogeneous() const { return heterogeneous_; }
  // World box outside which nothing is; infinite if unbounded, empty in vacuum.
  const Box3d& bounds() const { return bounds_; }
  // Shortest voxel edge of all grids; infinity without grids.
  double voxel_size() const { return voxel_size_; }

  // Of a volume that is not homogeneous; made when first asked for. Thread-safe.
  const BrickPyramid& pyramid(int volume) const;

  // Of all volumes together [1/world unit].
  RgbD sigma_t_at(const Vec3d& p) const;
  RgbD sigma_s_at(const Vec3d& p) const;
  Fingerprint fingerprint() const;

 private:
  struct Pyramids;
  std::vector<Volume> volumes_;
  std::shared_ptr<Pyramids> pyramids_;  // Copies share them.
  bool scatters_ = false, emits_ = false, chromatic_ = false, unbounded_ = false,
       heterogeneous_ = false;
  Box3d bounds_;
  double voxel_size_ = kInfinity;
};

}  // namespace brume
