// Radiance that surfaces send along gather rays, for many hits at a time: shadow rays go in
// packets.
#pragma once

#include <vector>

#include "core/random.h"
#include "gather/gather.h"

namespace brume {

// What a surface makes of light that arrives as irradiance: a glossy lobe reflects it as if it came
// evenly.
inline RgbD diffuse_reflectance(const Material& material) {
  return material.reflects() ? RgbD(material.albedo) + RgbD(material.specular) : RgbD();
}

// The shading normal on the side that reflects back along a ray of direction `w`.
inline Vec3d reflecting_normal(const Hit& hit, const Vec3d& w) {
  return hit.normal.dot(w) < 0 ? hit.shading_normal : -hit.shading_normal;
}

// Scratch memory of one thread.
class SurfaceLight {
 public:
  explicit SurfaceLight(const Lighting& lighting, bool want_derivatives = false)
      : lighting_(lighting), want_derivatives_(want_derivatives) {}

  // Places the points on lights that are asked, of one lattice over all cells, at random.
  void begin(std::size_t cells, RandomStream random);
  // `hit` as seen from direction `w` (towards the surface) in cell `cell`, whose ray stands for
  // what is `footprint` around it.
  void add(std::size_t cell, const Hit& hit, const Vec3d& w, double footprint,
           const HitLight& light, Counters& counters);
  // Traces what add() collected.
  void finish(Counters& counters);

  RgbD radiance(std::size_t cell) const { return emitted_[cell] + reflected_[cell]; }
  // Of emitters that only gathers see.
  const RgbD& emitted(std::size_t cell) const { return emitted_[cell]; }
  // d L_o / d w at the fixed hit: how radiance changes as the surface is seen from elsewhere; zero
  // but for glossy surfaces and emission lobes, and only where wanted.
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
  std::vector<Vec2d> lamp_shift_;  // By light: points on it follow one lattice over all cells.
  std::vector<RgbD> emitted_, reflected_;
  std::vector<RgbGradient> derivative_;
  std::vector<Pending> pending_;
  std::vector<ShadowRay> shadow_rays_;
  std::vector<std::uint8_t> occluded_;
  std::vector<Lighting::Request> requests_;
  std::vector<RgbD> transmittances_;
  bool has_derivatives_ = false;
};

}  // namespace brume
