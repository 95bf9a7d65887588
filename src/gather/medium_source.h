// What the medium sends towards a point from one stretch of a ray: light scattered straight from lights,
// and the medium's own glow.
#pragma once

#include <vector>

#include "core/random.h"
#include "gather/lighting.h"
#include "plan/effects.h"
#include "vdb_media/ray_marcher.h"

namespace brume {

// One shell's light, integrated over the shell and dimmed back to where the ray starts.
struct ShellLight {
  RgbD scattered, emitted;
  // sum of (dp/dc / p) * scattered * e over samples, e the way the light travels: the directional term
  // before its 1/t (gradients.md 3, T4). Only for anisotropic media.
  RgbGradient directional;
  RgbD total() const { return scattered + emitted; }
};

// Source terms along a marched ray. Scratch memory of one thread.
class MediumSource {
 public:
  MediumSource(const Lighting& lighting, const Effects& effects);

  // Light from each shell of `marcher`, which has just marched `ray` through `boundaries` up to t_end.
  // `random` gives area lights their points; visibility is traced in packets.
  const std::vector<ShellLight>& shells(const ShellMarcher& marcher, const Ray& ray,
                                        std::span<const double> boundaries, double t_end,
                                        std::span<const double> jitter, RandomStream& random,
                                        Counters& counters);

  // Q(p, w) per length that leaves p against w (towards a receiver that looks along w), area lights with
  // `samples` points. Visibility is traced.
  RgbD source_at(const Vec3d& p, const Vec3d& w, int samples, RandomStream& random,
                 Counters& counters) const;
  // One light's part of it for light sample position u, as if nothing were in the way.
  RgbD unshadowed(const Vec3d& p, const Vec3d& w, int light, const Vec2d& u,
                  Counters& counters) const;
  RgbD emission_at(const Vec3d& p) const;

 private:
  struct Pending {
    int shell, light, volume;
    LightSample sample;
    Vec3d position{0.0};
    RgbD strength;   // Everything but phase, transmittance to the light and visibility.
  };
  void add_scattering(const ShellMarcher& marcher, int shell, const Ray& ray, double a, double b,
                      double jitter, const RgbD& dimming, RandomStream& random);

  const Lighting& lighting_;
  Effects effects_;
  std::vector<ShellLight> shells_;
  std::vector<Pending> pending_;
  std::vector<double> chances_;  // Running sums over volumes, for choosing one.
  std::vector<ShadowRay> shadow_rays_;
  std::vector<std::uint8_t> occluded_;
};

}  // namespace brume
