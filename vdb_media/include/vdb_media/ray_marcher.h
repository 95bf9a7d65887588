// Walks rays through a medium: optical depth, and shells of it for gathers and eye rays.
//
// A grid is walked brick by brick and cell by cell (3-D DDA in index space). Inside a cell of eight
// nodes the density along a straight ray is a cubic, which two Gauss points integrate exactly, so at
// `step_voxels` <= 1 there is no step-size error (gradients.md 8). Coarser steps use two Gauss points
// a step of that many voxels.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/math.h"
#include "vdb_media/medium.h"

namespace brume {

struct MarchOptions {
  double step_voxels = 0;  // 0: exact (1).
};

// What was done; one a thread, merged at the end.
struct MarchCounters {
  std::uint64_t rays = 0;      // Rays that met a volume's bounds.
  std::uint64_t segments = 0;  // Steps in which density was sampled; homogeneous: one a ray or shell.
};

// The integral of density over `t`, in density * world units, in double. Works with an endless `t`.
double density_integral(const Volume& volume, const Ray& ray, Interval t, const MarchOptions& options,
                        MarchCounters& counters);

// tau = sum over volumes of sigma_t * density_integral.
RgbD optical_depth(const Medium& medium, const Ray& ray, Interval t, const MarchOptions& options,
                   MarchCounters& counters);

// One volume's share of one shell [t_i, t_i+1] of a ray.
struct ShellDensity {
  double integral = 0;  // Of density over the shell.
  // A distance in the shell drawn in proportion to density * transmittance (exact for one grey
  // volume; with others, in proportion to this volume's own), from the caller's uniform number.
  // Where integral is 0 it is uniform in the shell.
  double t_sample = 0;
};

// What marchers leave behind: the density of every volume along one ray, shell by shell, and what is
// left of light on its way to the ray's origin. A view of a marcher's arrays, valid until its next
// march; cheap to copy.
class MarchedShells {
 public:
  // Shells that begin before the ray's end.
  int shell_count() const { return shell_count_; }
  ShellDensity shell(int volume, int shell) const {
    const std::size_t i = at(volume, shell);
    return {integral_[i], sample_[i]};
  }
  // From a shell, averaged over it as if its density were even.
  RgbD transmittance(int shell) const { return channels(transmittance_, shell); }
  // From the ray's end.
  RgbD transmittance() const { return channels(end_, 0); }
  // Integrals over u from 0 (the ray's origin) to the start of `shell`, or to the ray's end, of grad
  // density and of u grad density, per volume: I0 and I1 of gradients.md 3, before sigma_t, with u in
  // world units and the gradient in the grid's index space (world_to_index().transposed_vector() takes
  // sums of them to world space). Only where gradients were wanted. The density before the first
  // boundary counts as none, so callers put it at or before the medium's entry.
  Vec3d grad_integral(int volume, int shell) const { return vector(gradient_, volume, shell); }
  Vec3d grad_moment(int volume, int shell) const { return vector(moment_, volume, shell); }

 private:
  friend class ShellMarcher;
  friend class ConeMarcher;
  // Rows are shells, one more than there are at most.
  std::size_t at(int volume, int shell) const {
    return (std::size_t(volume) * std::size_t(rows_) + std::size_t(shell)) * std::size_t(stride_);
  }
  RgbD channels(const float* of, int row) const {
    if (channel_count_ == 1) return RgbD(of[at(0, row)]);
    return {of[at(0, row)], of[at(1, row)], of[at(2, row)]};
  }
  Vec3d vector(const std::array<const float*, 3>& of, int volume, int shell) const {
    const std::size_t i = at(volume, shell);
    return {of[0][i], of[1][i], of[2][i]};
  }

  int shell_count_ = 0, rows_ = 0, stride_ = 1, channel_count_ = 1;
  const float *integral_ = nullptr, *sample_ = nullptr;
  const float *transmittance_ = nullptr, *end_ = nullptr;
  std::array<const float*, 3> gradient_{}, moment_{};
};

// Marches cell by cell, cut at common boundaries. Reusable scratch memory: make one a thread. Results
// stay valid until the next march().
class ShellMarcher {
 public:
  // The Medium must outlive it. Copies share nothing.
  explicit ShellMarcher(const Medium& medium, MarchOptions options);
  ~ShellMarcher();
  ShellMarcher(const ShellMarcher& other);
  ShellMarcher& operator=(const ShellMarcher& other);
  ShellMarcher(ShellMarcher&&) noexcept;
  ShellMarcher& operator=(ShellMarcher&&) noexcept;

  // Marches from boundaries.front() to min(boundaries.back(), t_end); shells past t_end are zero and
  // the one that holds t_end is cut there. `boundaries` ascend, at least two. `jitter` has one number
  // in [0,1) a shell, used for every volume's t_sample. With `want_gradients` also the weighted
  // integrals of grad density.
  void march(const Ray& ray, std::span<const double> boundaries, double t_end,
             std::span<const double> jitter, bool want_gradients, MarchCounters& counters);

  int shell_count() const { return shell_count_; }
  const ShellDensity& shell(int volume, int shell) const {
    return shells_[std::size_t(volume) * stride_ + shell];
  }
  // sum over volumes of sigma_t * integral of density, from boundaries.front() to the start of
  // `shell` (or to t_end for shell == shell_count()).
  const RgbD& tau(int shell) const { return tau_[shell]; }
  // As MarchedShells', in double.
  const Vec3d& grad_integral(int volume, int shell) const {
    return i0_[std::size_t(volume) * stride_ + shell];
  }
  const Vec3d& grad_moment(int volume, int shell) const {
    return i1_[std::size_t(volume) * stride_ + shell];
  }
  MarchedShells view();

 private:
  template <bool kGradients>
  void march_grid(int volume, const Ray& ray, std::span<const double> jitter,
                  MarchCounters& counters);
  void march_homogeneous(int volume, const Ray& ray, std::span<const double> jitter,
                         MarchCounters& counters);

  const Medium* medium_;
  MarchOptions options_;
  bool has_gradients_ = false;
  int shell_count_ = 0;
  std::size_t stride_ = 0;
  std::vector<ShellDensity> shells_;
  std::vector<RgbD> tau_;
  std::vector<Vec3d> i0_, i1_;
  struct Scratch;
  std::unique_ptr<Scratch> scratch_;
};

}  // namespace brume
