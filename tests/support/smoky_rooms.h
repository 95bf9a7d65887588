// Small closed scenes made in memory, and caches and frames of them.
#pragma once

#include <functional>

#include "bake/bake.h"
#include "render/cached_renderer.h"
#include "support/dense_grid.h"
#include "support/scene_builder.h"

namespace brume::test {

// A lump that fades to 0 at the faces of `box`, of density 1 in its middle.
inline double lump(const Box3d& box, const Vec3d& p) {
  double product = 1;
  for (int a = 0; a < 3; ++a) {
    const double q = (p[a] - box.min[a]) / (box.max[a] - box.min[a]);
    product *= std::max(0.0, 4 * q * (1 - q));
  }
  return product * (1 + 0.4 * std::sin(11 * p.x + 7 * p.y) * std::sin(9 * p.z));
}

inline Volume haze(const RgbD& sigma_s, const RgbD& sigma_a, double g, const Box3d& bounds) {
  Volume v;
  v.sigma_s = sigma_s;
  v.sigma_a = sigma_a;
  v.phase = HenyeyGreenstein(static_cast<float>(g));
  v.bounds = bounds;
  return v;
}

inline Volume smoke(const RgbD& sigma_s, const RgbD& sigma_a, double g,
                    const Box3d& box = {Vec3d(0.2, 0.05, 0.2), Vec3d(0.85, 0.8, 0.8)}) {
  Volume v = haze(sigma_s, sigma_a, g, box);
  v.density = dense_grid(box, 17, [&](const Vec3d& p) { return lump(box, p); });
  return v;
}

inline const Box3d kUnitBox{Vec3d(0.0), Vec3d(1.0)};

// The unit box with two blocks in it, unlit and clear.
inline Scene blocks_in_a_room() {
  Scene scene;
  const auto white = add_material(scene, diffuse(0.6f));
  Material tinted = diffuse(0.5f);
  tinted.albedo = Rgb(0.6f, 0.3f, 0.15f);
  const auto red = add_material(scene, tinted);
  add_room(scene, kUnitBox, white);
  add_room(scene, {Vec3d(0.15, 0, 0.2), Vec3d(0.4, 0.55, 0.45)}, white);
  add_room(scene, {Vec3d(0.6, 0, 0.45), Vec3d(0.85, 0.3, 0.7)}, red);
  return scene;
}

inline void add_lamps(Scene& scene, float scale = 1) {
  QuadLight quad;
  quad.corner = {0.35, 0.98, 0.35};
  quad.edge_u = {0.3, 0, 0};
  quad.edge_v = {0, 0, 0.3};
  quad.radiance = Rgb(8 * scale, 7 * scale, 6 * scale);
  scene.lights.emplace_back(quad);  // Faces edge_u x edge_v: down.
  scene.lights.emplace_back(PointLight{{0.8, 0.6, 0.9}, Rgb(0.1f * scale)});
}

inline Scene smoky_room() {
  Scene scene = blocks_in_a_room();
  add_lamps(scene);
  scene.volumes.push_back(smoke(RgbD(3.0), RgbD(1.0), 0.4));
  return scene;
}

inline Camera room_camera() {
  Camera camera;
  camera.position = {0.5, 0.5, 0.98};
  camera.look_at = {0.5, 0.4, 0};
  camera.fov_deg = 75;
  return camera;
}

inline BakeView room_view(int width, int height) { return {"room", room_camera(), width, height}; }

// Coarse: seconds at most.
inline BakeSettings coarse_settings(int bounces = 2) {
  BakeSettings s;
  s.gather.cells_theta = 8;
  s.gather.cells_phi = 25;
  s.gather.shells = 12;
  s.bounces = bounces;
  s.min_radius = 0.02;
  s.max_radius = 0.2;
  return s;
}

// A world lit for baking and rendering.
struct Stage {
  explicit Stage(const Scene& scene, const BakeSettings& settings_ = coarse_settings())
      : settings(settings_),
        world(scene),
        lighting(world, {.depth = settings_.light_depth, .threads = 2}) {}

  BakeResult bake(const BakeRequest& request, const IrradianceCache* existing = nullptr) const {
    return brume::bake(lighting, settings, request, existing);
  }
  BakeResult bake(const BakeView& view, const IrradianceCache* existing = nullptr) const {
    BakeRequest request;
    request.views = {view};
    request.threads = 2;
    return bake(request, existing);
  }
  BakeResult bake_everywhere() const {
    BakeRequest request;
    request.everywhere = true;
    request.threads = 2;
    return bake(request);
  }
  PixelFilm render(const IrradianceCache& cache, const BakeView& view,
                   const CachedRenderOptions& options, Counters* counters = nullptr) const {
    PixelFilm film(view.width, view.height);
    const CameraRays rays(view.camera, view.width, view.height);
    const CachedRenderResult r = render_cached(lighting, settings, cache, rays, options, film);
    if (counters) *counters = r.counters;
    return film;
  }

  BakeSettings settings;
  World world;
  Lighting lighting;
};

}  // namespace brume::test
