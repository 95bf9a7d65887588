// One eye ray of the reference path tracer, followed to every light. Private to the path tracer.
#pragma once

#include <cstdint>
#include <vector>

#include "render/film.h"
#include "render/medium_tracking.h"
#include "render/path_tracer.h"
#include "render/sample_points.h"
#include "scene/world.h"

namespace brume {

// Scratch memory and counters of one thread; World and options must outlive it.
class ReferencePaths {
 public:
  ReferencePaths(const World& world, const PathTracerOptions& options);

  // The answer of one sample. z is the distance, infinite where the ray hits nothing; normal and
  // position are 0 there.
  PixelResult trace(const Ray& ray, const SamplePoints& points, RandomStream& random);

  // One sample of irradiance at a point of a surface, on the side of the unit normal, but for what arrives
  // straight from lights: diffuse_indirect without the albedo over pi. `u`: where its ray goes.
  RgbD indirect_irradiance(const Hit& hit, const Vec3d& normal, const Vec2d& u,
                           RandomStream& random);

  std::uint64_t rays() const { return rays_; }
  std::uint64_t lookups() const { return tracker_.lookups(); }

 private:
  struct Surface;
  // f cos of two lobes that go to different layers, and the density with which a ray of the same
  // path, weighted against light samples, goes the same way (0: there is none).
  struct Lobes {
    RgbD value[2];
    double pdf[2] = {0, 0};
  };
  struct Reflected {
    RgbD value[2];
    RgbD sum() const { return value[0] + value[1]; }
  };
  // What a ray brings back: light straight from sampled lights, weighted against light sampling at
  // the ray's origin, and all other light.
  struct Gathered {
    RgbD direct, indirect;
  };
  // A ray drawn at `from` with density `pdf`.
  struct DrawnRay {
    Ray ray;
    Vec3d from{0.0};
    double pdf = 0;
  };
  struct SingularLight {
    int light;
    Vec3d position;
  };

  Surface surface_at(const Hit& hit, const Vec3d& wo) const;
  Hit intersect(const Ray& ray);
  RgbD visibility(const Vec3d& origin, const LightSample& sample, RandomStream& random);
  template <typename Eval>
  Reflected direct_light(const Vec3d& p, bool in_medium, const Eval& eval,
                         const SamplePoints* points, RandomStream& random);
  RgbD direct_in_medium(const Vec3d& p, const Vec3d& direction, int volume, bool goes_on,
                        const SamplePoints* points, RandomStream& random);
  RgbD direct_on_surface(const Surface& surface, RandomStream& random);
  DrawnRay scattered_ray(const Vec3d& p, const Vec3d& direction, int volume, const Vec2d& u) const;
  // Multiplies `weight` by what the reflection leaves of it; 0: there is no ray.
  DrawnRay reflected_ray(const Surface& surface, RgbD& weight, RandomStream& random) const;
  double near_share(int light, const Vec3d& p) const;
  RgbD glow(const Ray& ray, double t_end, RandomStream& random);
  RgbD emitter_hit(const Hit& hit, const DrawnRay& drawn) const;
  RgbD environment_hit(const DrawnRay& drawn) const;

  void shade_eye(const Surface& surface, const RgbD& transmittance, const SamplePoints& points,
                 RandomStream& random, PixelResult& result);
  // Results are multiplied by `weight`, that of the path so far. `scatterings`: in the medium, from
  // the eye or the last surface to where the ray begins.
  Gathered gather(const DrawnRay& drawn, const RgbD& weight, int scatterings,
                  RandomStream& random);
  Gathered gather_cached(DrawnRay drawn, RgbD weight, int scatterings, RandomStream& random);
  Gathered gather_full(DrawnRay drawn, RgbD weight, RandomStream& random);

  const World& world_;
  const PathTracerOptions& options_;
  MediumTracker tracker_;
  std::vector<SingularLight> singular_lights_;
  double singular_radius_ = 0;
  std::vector<double> light_cdf_;  // By importance; for scenes of many lights.
  std::uint64_t rays_ = 0;
};

}  // namespace brume
