// Marches the rays of a gather as coarsely as what they stand for allows. A ray that is `width` * t
// wide at t stands for all that is there, so the density is looked at in steps of that length, on a
// level of its pyramid with voxels a quarter as long (docs/decisions/0014). Steps are shorter where
// they could be thick, but no shorter than a voxel.
#pragma once

#include "vdb_media/ray_marcher.h"

namespace brume {

class BrickPyramid;

// One ray of a gather. `place` and `choice` in [0, 1), even over rays, say where in its steps it looks
// and which of a shell's steps stands for the shell.
struct ConeRay {
  Vec3d direction{0.0, 0.0, 1.0};
  double end = kInfinity;
  float place = 0, choice = 0;
};

// Reusable scratch memory: make one a thread. Results stay valid until the next march().
//
// Each step is one sample of the density and its gradient: means over evenly placed rays are those of
// the level's field exactly, and a single ray is off by what the field wiggles within its steps.
// Shells' samples lie where the density was looked at. Positions are floats in voxels from the grid's
// corner: good to a hundredth of a voxel in grids of a hundred thousand.
class ConeMarcher {
 public:
  static constexpr int kRays = 16;  // At once.

  // The Medium must outlive it, and holds the pyramids.
  explicit ConeMarcher(const Medium& medium, double step_voxels = 0);
  ~ConeMarcher();
  ConeMarcher(ConeMarcher&&) noexcept;

  // All rays until the next call start at `origin` and go through the same shells, by `boundaries`,
  // which ascend. `random` shifts where rays look, a shell each.
  void begin(const Vec3d& origin, std::span<const double> boundaries, double width,
             std::span<const float> shifts);

  // At most kRays.
  void march(std::span<const ConeRay> rays, bool want_gradients, MarchCounters& counters);
  MarchedShells ray(int i) const;

 private:
  struct State;
  void add_track(int volume, double width, std::span<const float> shifts);
  void march_volume(int volume, std::span<const ConeRay> rays, bool want_gradients,
                    MarchCounters& counters);
  void dim();

  const Medium* medium_;
  double step_voxels_;  // At least so long are steps.
  Vec3d origin_{0.0};
  std::vector<double> boundaries_;
  std::unique_ptr<State> state_;
};

}  // namespace brume
