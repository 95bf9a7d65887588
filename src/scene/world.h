// A scene made ready for rays: geometry in the ray tracer, lights that can be sampled, the medium.
#pragma once

#include <memory>
#include <vector>

#include "core/hash.h"
#include "geom/ray_tracer.h"
#include "scene/light.h"
#include "scene/scene.h"
#include "vdb_media/medium.h"

namespace brume {

// Immutable, shared by all threads.
class World {
 public:
  // Quad lights become black two-triangle meshes, seen by eye rays and blocking light like any other.
  // Throws Error(InvalidInput) for an unbounded medium with a directional or environment light.
  explicit World(const Scene& scene);

  const RayTracer& tracer() const { return *tracer_; }
  const Medium& medium() const { return medium_; }
  const std::vector<std::unique_ptr<Light>>& lights() const { return lights_; }
  // Of the lights, those at infinity that eye and gather rays see; lights()[i] for each.
  const std::vector<int>& environment_lights() const { return environment_lights_; }
  double unit() const { return unit_; }
  // All geometry and bounded media together; the scene's diagonal is what lengths are compared with.
  const Box3d& bounds() const { return bounds_; }
  double diagonal() const { return (bounds_.max - bounds_.min).length(); }

  const Material& material(const Hit& hit) const { return materials_[hit.material]; }
  // The light a hit belongs to, or -1: an emitter that is sampled directly.
  int light_at(const Hit& hit) const;
  // Radiance that leaves the hit towards `wo` by emission, whatever samples it.
  RgbD emission(const Hit& hit, const Vec3d& wo) const;
  // Its derivative by wo; zero but for emission lobes.
  RgbGradient emission_derivative(const Hit& hit, const Vec3d& wo) const;
  // Environment radiance along a ray that leaves the scene.
  RgbD background(const Vec3d& direction) const;

  bool has_glossy() const { return has_glossy_; }
  // Emitters with "direct": false, which only gathers and eyes see.
  bool has_gathered_emitters() const { return has_gathered_emitters_; }
  // Geometry, materials, lights and media: what an irradiance depends on (SPEC, Caches).
  Fingerprint fingerprint() const { return fingerprint_; }

 private:
  std::unique_ptr<RayTracer> tracer_;
  Medium medium_;
  std::vector<std::unique_ptr<Light>> lights_;
  std::vector<int> environment_lights_;
  std::vector<Material> materials_;
  std::vector<int> material_light_;  // By material: index of its mesh light, or -1.
  double unit_ = 1;
  Box3d bounds_;
  bool has_glossy_ = false, has_gathered_emitters_ = false;
  Fingerprint fingerprint_;
};

}  // namespace brume
