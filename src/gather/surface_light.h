// Radiance that surfaces send along gather rays, for many hits at a time: shadow rays go in packets.
#pragma once

#include <vector>

#include "core/random.h"
#include "gather/gather.h"

namespace brume {

// Scratch memory of one thread.
class SurfaceLight {
 public:
  explicit SurfaceLight(const Lighting& lighting, bool want_derivatives = false)
      : lighting_(lighting), want_derivatives_(want_derivatives) {}

  void begin(std::size_t cells);
  // `hit` as seen from direction `w` (towards the surface) in cell `cell`; random numbers from `random`.
  void add(std::size_t cell, const Hit& hit, const Vec3d& w, const HitLight& light,
           RandomStream& random, Counters& counters);
  // Traces what add() collected.
  void finish(Counters& counters);

  const RgbD& radiance(std::size_t cell) const { return radiance_[cell]; }
  // d L_o / d w at the fixed hit: how radiance changes as the surface is seen from elsewhere; zero but for
  // glossy surfaces and emission lobes, and only where wanted.
  const RgbGradient& direction_derivative(std::size_t cell) const { return derivative_[cell]; }
  bool has_derivatives() const { return has_derivatives_; }

 private:
  struct Pending {
    std::size_t cell;
    int light;
    LightSample sample;
    Vec3d origin{0.0};
    RgbD reflected;          // f cos weight, before transmittance.
    RgbGradient derivative;  // The same, of direction_derivative.
  };

  const Lighting& lighting_;
  bool want_derivatives_;
  std::vector<RgbD> radiance_;
  std::vector<RgbGradient> derivative_;
  std::vector<Pending> pending_;
  std::vector<ShadowRay> shadow_rays_;
  std::vector<std::uint8_t> occluded_;
  bool has_derivatives_ = false;
};

}  // namespace brume
