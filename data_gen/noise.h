// Smooth random functions of position, the same on every machine and thread.
#pragma once

#include <cstdint>

#include "core/math.h"

namespace brume {

// Perlin's gradient noise [Per02] on the unit lattice: 0 at lattice points, about [-1, 1], twice
// differentiable. Different seeds give unrelated functions.
class GradientNoise {
 public:
  explicit GradientNoise(std::uint64_t seed) : seed_(seed) {}

  struct Sample {
    double value = 0;
    Vec3d gradient{0.0};
  };
  Sample at(const Vec3d& p) const;
  double value(const Vec3d& p) const { return at(p).value; }

  // Sum of `octaves` copies, each of twice the frequency and `gain` times the amplitude of the one
  // before, divided by the sum of the amplitudes.
  double fractal(const Vec3d& p, int octaves, double gain = 0.5) const;

 private:
  std::uint64_t seed_;
};

// A divergence-free flow: the curl of three noises [BHN07]. Speeds are of order 1.
class CurlNoise {
 public:
  explicit CurlNoise(std::uint64_t seed);
  Vec3d velocity(const Vec3d& p) const;

 private:
  GradientNoise x_, y_, z_;
};

// 0 below a, 1 above b, smooth between.
inline double smooth_step(double a, double b, double x) {
  const double t = std::clamp((x - a) / (b - a), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

}  // namespace brume
