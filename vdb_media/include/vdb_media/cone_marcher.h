// Marches the rays of a gather as coarsely as what they stand for allows. A ray that is `width` * t
// wide at t stands for all that is there, so the density is looked at in steps of that length, on a
// level of its pyramid with voxels a quarter as long (docs/decisions/0014). Steps are shorter where
// they could be thick, but no shorter than a voxel.
#pragma once

#include "vdb_media/brick_pyramid.h"
#include "vdb_media/ray_marcher.h"

namespace brume {

// Reusable scratch memory: make one a thread. Results stay valid until the next march().
//
// Each step is one sample of the density and its gradient, at the place in it that the caller's
// `offset` gives: means of depth over even offsets are those of the level's field exactly, and a
// single ray is off by what the field wiggles within its steps. Shells' samples lie where the density
// was looked at.
class ConeMarcher : public MarchedShells {
 public:
  // The Medium must outlive it, and holds the pyramids.
  explicit ConeMarcher(const Medium& medium, double step_voxels = 0)
      : medium_(&medium), step_voxels_(step_voxels) {}

  // All rays until the next call start at `origin` and go through the same shells, by `boundaries`.
  void begin(const Vec3d& origin, std::span<const double> boundaries, double width);

  // As ShellMarcher::march(). `offset` in [0, 1) places the samples within steps.
  void march(const Vec3d& direction, double t_end, double offset, std::span<const double> jitter,
             bool want_gradients, MarchCounters& counters);

 private:
  struct Step {
    double begin = 0, end = 0;
    int shell = 0, level = 0;
  };
  // One level of one volume, as seen from the origin.
  struct Level {
    const BrickGrid* grid = nullptr;
    Vec3d origin{0.0};
  };
  struct Track {
    std::vector<Step> steps;
    std::vector<Level> levels;
    Box3d box;  // In the index space of the finest level, around the fields of all that are used.
  };
  double step_length(const Volume& volume, const BrickPyramid& pyramid, double wanted) const;
  void add_steps(const Volume& volume, const BrickPyramid& pyramid, double width,
                 Track& track) const;
  template <bool kGradients>
  void march_grid(int volume, const Ray& ray, double offset, std::span<const double> jitter,
                  MarchCounters& counters);

  const Medium* medium_;
  double step_voxels_ = 0;  // At least so long are steps.
  Vec3d origin_{0.0};
  std::vector<double> boundaries_;
  std::vector<Track> tracks_;  // By volume.
  // Of the steps of the ray at hand.
  std::vector<double> depths_, places_;
};

}  // namespace brume
