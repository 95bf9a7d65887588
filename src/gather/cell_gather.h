// What the cells around a point see: one stratified gather, before it is summed into irradiance or
// into moments of what arrives in the medium. Private to gather/.
//
// The terms of the gradient are those of form F, cell by cell and wall by wall (gradients.md 3), so
// that either sum may weight them by direction.
#pragma once

#include <vector>

#include "core/random.h"
#include "gather/bend.h"
#include "gather/cell_noise.h"
#include "gather/direction_cells.h"
#include "gather/gather.h"
#include "gather/guided_rays.h"
#include "gather/medium_source.h"
#include "gather/surface_light.h"
#include "vdb_media/cone_marcher.h"

namespace brume {

// Radiance that arrives along one cell's direction.
struct CellLight {
  RgbD surface, media;
  RgbD emitted;              // Part of surface: emitters that only gathers see.
  double over_distance = 0;  // Luminance of light times 1/t of where it comes from.
  // T3 and T4 of gradients.md 3 without the cell's measure; with mode Full only.
  RgbGradient grad_sigma, directional;
  RgbD total() const { return surface + media; }
};

// Scratch memory of one thread. The World and Lighting must outlive it.
class CellGather {
 public:
  CellGather(const Lighting& lighting, const Effects& effects, const GatherOptions& options,
             DirectionDomain domain);

  // `base` is turned about its normal at random. A pure function of the world, options and
  // arguments.
  void gather(const Vec3d& origin, const Frame& base, std::uint64_t key, const HitLight& light,
              Counters& counters);

  // What follows belongs to the last gather().
  const DirectionCells& cells() const { return cells_; }
  const Frame& frame() const { return frame_; }
  Vec3d direction(int c) const { return cell_[c].w; }
  double hit_distance(int c) const { return cell_[c].s; }  // Infinite for a miss.
  const CellLight& light(int c) const { return light_[c]; }
  const Strata& strata() const { return strata_; }
  int shell_count() const {
    return boundaries_.empty() ? 0 : static_cast<int>(boundaries_.size()) - 1;
  }
  bool has_radial_term() const {
    return !boundaries_.empty() && (!is_black(sigma_here_) || effects_.emission);
  }
  // sigma L - Q of T1 for a cell, once look_here() has found what the medium sends from the point
  // itself.
  void look_here(Counters& counters);
  RgbD radial(int c) const { return sigma_here_ * light_[c].total() - here_.towards(-cell_[c].w); }
  // Phi of the wall's high side less that of its low side.
  RgbD across(const CellWall& wall) const { return phi_[wall.high_side] - phi_[wall.low_side]; }
  // Makes across() what [WH92] takes: all of a cell's light comes from its surface.
  void use_surface_distances();
  // Estimated standard error of the sum of all cells' light, luminance.
  double error() const;
  // How a cell's light changes with a medium that moves with the point and that nothing occludes:
  // the integral of Tr (grad Q - Q I0) - f_s I0. The comparison that [JZJ08] improves on.
  // For all cells in order, after start_over(): then from the samples of the last gather().
  RgbGradient moving_medium(int c, Counters& counters);
  void start_over();  // Lamp samples are drawn from the first again.
  bool has_moving_medium() const {
    return !boundaries_.empty() && (effects_.heterogeneous || has_source());
  }

 private:
  // What pass 1 knows of a cell: the direction, what it hit, and that hit's plane.
  struct Cell {
    Vec3d w{0.0};  // World space.
    double s = kInfinity;
    Vec3d q{0.0};  // Along any direction d the hit plane lies at 1/r = q.d; 0 for a miss.
  };

  MarchOptions march_options() const;
  bool marches_exactly() const { return !(options_.footprint > 0); }
  bool has_source() const { return effects_.scattering || scattered_ != nullptr; }
  bool is_full() const { return options_.gradient == GradientMode::Full; }
  void trace(const HitLight& light, Counters& counters);
  void find_walls();
  static double inverse_wall_distance(const Cell& a, const Cell& b, const Vec3d& wall);
  void choose_shells();
  // Slots are rays: of the cells, then guided ones.
  int slot_count() const { return static_cast<int>(rays_.size()); }
  double end_of(int slot) const { return hits_[static_cast<std::size_t>(slot)].t; }
  ShellJitter jitter(int slot) const;
  void march(int first, int count, bool gradients, Counters& counters);
  void add_rays(int first, int count, Counters& counters);
  double share_of(int slot) const;
  // Of what a ray's medium sends, a share that counts of it, as part of a cell's light. Returns the
  // luminance of what it added.
  double add_medium(int c, int slot, const MarchedShells& marched,
                    std::span<const MediumLight> sent, double share);
  double add_surface(int c, int slot, const MarchedShells* marched, const RgbD& dimming);
  double inverse_distance_within(int slot) const;
  void keep_stratum(int c, int slot, const RgbD& dimming);
  void keep_medium_points(int c, const MarchedShells& marched);
  static Vec3d bend_integral(const MarchedShells& marched, int volume, int shell, double inverse_t);
  Ray ray_of(const Cell& seen) const { return {origin_, seen.w}; }
  RandomStream stream(int of_cell, int use) const {
    return RandomStream(random_key(key_, of_cell, use));
  }

  const Lighting& lighting_;
  const World& world_;
  Effects effects_;
  GatherOptions options_;
  ShellMarcher exact_;
  ConeMarcher cones_;
  std::vector<MarchedShells> marched_;  // Of the batch at hand, by one of them.
  SurfaceLight surfaces_;
  MediumSource medium_;
  GuidedRays guided_;

  DirectionCells cells_;
  CellNoise noise_;
  Frame frame_{Vec3d(0.0, 0.0, 1.0)};
  Vec3d origin_{0.0};
  std::uint64_t key_ = 0;
  const IncidentField* scattered_ = nullptr;
  RgbD sigma_here_;
  SourceAtPoint here_;
  std::vector<Cell> cell_;
  std::vector<Ray> rays_;
  std::vector<Hit> hits_;
  std::vector<CellLight> light_;
  std::vector<double> own_;          // Luminance of what a cell's own ray brings.
  std::vector<double> from_guided_;  // Of a guided ray, times its cell's measure.
  Strata strata_;
  std::vector<MediumStretch> stretches_;
  std::vector<double> inverse_r_;  // 1/r at each side of a wall.
  std::vector<RgbD> phi_;          // Phi of gradients.md 3, at each side of a wall.
  std::vector<double> boundaries_, jitter_;
  std::vector<float> shell_shift_;
  double step_shift_ = 0;
  std::vector<ConeRay> cone_rays_;
  std::vector<Bend> bends_;  // Of volumes that are grids.
};

}  // namespace brume
