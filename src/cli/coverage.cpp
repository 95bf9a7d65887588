#include <atomic>

#include "cli/cache_session.h"
#include "core/parallel.h"
#include "core/random.h"
#include "geom/surface_area.h"
#include "scene/camera_rays.h"

namespace brume {
namespace {

constexpr std::size_t kSurfacePoints = 1 << 16;

bool is_covered(const World& world, const IrradianceCache& cache, const Hit& hit,
                const Vec3d& normal, double min_radius) {
  if (!world.material(hit).reflects()) return true;
  return cache.covers(pixel_query(world, hit.position, normal, min_radius));
}

Coverage of_view(const World& world, const IrradianceCache& cache, const BakeView& view,
                 int threads) {
  const CameraRays rays(view.camera, view.width, view.height);
  std::atomic<std::size_t> asked{0}, uncovered{0};
  parallel_for(threads, static_cast<std::size_t>(view.height), 4, [&](std::size_t y) {
    for (int x = 0; x < view.width; ++x) {
      const Ray ray = rays.ray(x + 0.5, static_cast<double>(y) + 0.5);
      const Hit hit = world.tracer().intersect(ray);
      if (!hit.is_hit()) continue;
      const double side = hit.normal.dot(ray.direction) < 0 ? 1 : -1;
      const double footprint = kFootprintPixels * rays.pixel_angle() * hit.t;
      ++asked;
      if (!is_covered(world, cache, hit, hit.shading_normal * side, footprint)) ++uncovered;
    }
  });
  return {asked, uncovered};
}

// Points of the front sides, stratified by area.
Coverage of_surfaces(const World& world, const BakeSettings& settings, const IrradianceCache& cache,
                     int threads) {
  const SurfaceArea surfaces(world.tracer());
  if (!(surfaces.area() > 0)) return {};
  std::atomic<std::size_t> uncovered{0};
  parallel_for(threads, kSurfacePoints, 256, [&](std::size_t i) {
    RandomStream random(random_key(settings.seed, i));
    const double at = (static_cast<double>(i) + random.uniform()) / kSurfacePoints;
    const Hit hit = surfaces.point(at, random.uniform2());
    if (!is_covered(world, cache, hit, hit.shading_normal, 0)) ++uncovered;
  });
  return {kSurfacePoints, uncovered};
}

}  // namespace

Coverage measure_coverage(const World& world, const BakeSettings& settings,
                          const IrradianceCache& cache, const BakeRequest& request) {
  if (request.everywhere) return of_surfaces(world, settings, cache, request.threads);
  Coverage sum;
  for (const BakeView& view : request.views) {
    const Coverage one = of_view(world, cache, view, request.threads);
    sum.asked += one.asked;
    sum.uncovered += one.uncovered;
  }
  return sum;
}

}  // namespace brume
