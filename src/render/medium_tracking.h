// Unbiased flights through the medium by tentative collisions: delta tracking, ratio tracking and
// what lies between. Private to the path tracer; no marching code of vdb_media is used, so that
// each checks the other.
//
// Every volume is a Poisson process of its own along a ray, with the largest density of each brick
// for a rate. Processes add up, so overlapping volumes need no common grid. Extinction may differ
// between channels: the collisions are shared and the weights are not [KHLN17].
#pragma once

#include <cstdint>
#include <vector>

#include "core/math.h"
#include "core/random.h"
#include "vdb_media/medium.h"

namespace brume {

// Where light may scatter: a point, the volume that scatters there, and the colour a path is
// multiplied by.
struct ScatterPoint {
  bool is_set = false;
  double t = 0;
  int volume = 0;
  RgbD weight;
};

// One ray through the medium, seen whole: expected values along it, none of the path lost.
struct Sweep {
  RgbD transmittance{1.0}, emission;
  ScatterPoint scatter;  // One of many, chosen in proportion to its weight.
};

// One flight: it ends at the first scattering or at the end of the ray.
struct Flight {
  RgbD weight{1.0};  // Of whatever comes next, albedo included; 0: absorbed.
  RgbD emission;
  ScatterPoint scatter;
};

// Scratch memory and counter of one thread. The Medium must outlive it.
class MediumTracker {
 public:
  explicit MediumTracker(const Medium& medium);
  ~MediumTracker();
  MediumTracker(MediumTracker&&) noexcept;

  // Estimates of exp(-tau), each channel's mean exact [NSJ14].
  RgbD transmittance(const Ray& ray, double t_end, RandomStream& random);
  // Results are multiplied by `weight`, that of the path so far: where channels differ, choices
  // that know it keep the product bounded over any number of scatterings.
  Sweep sweep(const Ray& ray, double t_end, const RgbD& weight, RandomStream& random);
  Flight fly(const Ray& ray, double t_end, const RgbD& weight, RandomStream& random);

  // sigma_s of each volume at p; the volume is drawn in proportion.
  ScatterPoint scatter_at(const Vec3d& p, double u);

  std::uint64_t lookups() const { return lookups_; }

 private:
  class Process;
  void start(const Ray& ray, double t_end, double boost, double min_rate, RandomStream& random);
  Process* earliest();

  const Medium* medium_;
  double min_rate_ = 0;
  std::vector<Process> processes_;
  std::uint64_t lookups_ = 0;
};

}  // namespace brume
