#include "bake/placement.h"

#include <unordered_map>

#include "core/random.h"
#include "core/sampling.h"
#include "scene/camera_rays.h"

namespace brume {
namespace {

SurfacePoint point_of(const Hit& hit, bool front, double min_radius) {
  return {hit.position, front ? hit.shading_normal : -hit.shading_normal, hit.offset, min_radius};
}

struct CellHash {
  std::size_t operator()(const std::array<std::int64_t, 3>& c) const {
    return random_key(c[0], c[1], c[2]);
  }
};

}  // namespace

SurfacePoints::SurfacePoints(const RayTracer& tracer) : tracer_(tracer) {
  double sum = 0;
  for (std::uint32_t m = 0; m < tracer.meshes().size(); ++m) {
    const TriangleMesh& mesh = tracer.meshes()[m];
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto& [a, b, c] = mesh.triangles[t];
      sum += (mesh.positions[b] - mesh.positions[a])
                 .cross(mesh.positions[c] - mesh.positions[a])
                 .length() / 2;
      cumulative_.push_back(sum);
      triangle_.emplace_back(m, t);
    }
  }
}

std::vector<SurfacePoint> SurfacePoints::points(double spacing, std::uint64_t seed) const {
  constexpr double kMostPoints = 2e7;
  std::vector<SurfacePoint> points;
  if (!(area() > 0)) return points;
  const auto n = static_cast<std::size_t>(
      std::clamp(std::ceil(area() / (spacing * spacing)), 1.0, kMostPoints));
  points.reserve(2 * n);
  // Inside a triangle an additive recurrence on the plastic number leaves no holes, as chance would.
  constexpr double kAlpha1 = 0.7548776662466927, kAlpha2 = 0.5698402909980532;
  std::size_t last = triangle_.size(), inside = 0;
  Vec2d start(0.0);
  for (std::size_t i = 0; i < n; ++i) {
    RandomStream random(random_key(seed, n, i));
    const double at = (i + random.uniform()) / n * area();
    const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), at);
    const std::size_t t = std::min<std::size_t>(found - cumulative_.begin(), cumulative_.size() - 1);
    if (t != last) {
      last = t;
      inside = 0;
      start = random.uniform2();
    }
    const double u = start.x + kAlpha1 * inside, v = start.y + kAlpha2 * inside;
    ++inside;
    const Hit hit = tracer_.point_on(triangle_[t].first, triangle_[t].second,
                                     sample_triangle({u - std::floor(u), v - std::floor(v)}));
    points.push_back(point_of(hit, true, 0));
    points.push_back(point_of(hit, false, 0));
  }
  return points;
}

int placement_waves(double coarsest, double finest) {
  constexpr int kMostWaves = 128;
  return std::min(kMostWaves,
                  static_cast<int>(std::ceil(std::log2(std::max(1.0, coarsest / finest)))) + 2);
}

std::vector<SurfacePoint> thin(const std::vector<SurfacePoint>& points, double distance) {
  std::unordered_map<std::array<std::int64_t, 3>, std::vector<std::size_t>, CellHash> grid;
  const auto cell_of = [&](const Vec3d& p) {
    return std::array<std::int64_t, 3>{static_cast<std::int64_t>(std::floor(p.x / distance)),
                                       static_cast<std::int64_t>(std::floor(p.y / distance)),
                                       static_cast<std::int64_t>(std::floor(p.z / distance))};
  };
  std::vector<SurfacePoint> kept;
  for (const SurfacePoint& p : points) {
    const auto c = cell_of(p.position);
    const auto is_close = [&] {
      for (int i = 0; i < 27; ++i) {
        const auto found = grid.find({c[0] + i % 3 - 1, c[1] + i / 3 % 3 - 1, c[2] + i / 9 - 1});
        if (found == grid.end()) continue;
        for (const std::size_t k : found->second)
          if ((kept[k].position - p.position).length2() < distance * distance &&
              kept[k].normal.dot(p.normal) > kMaxNormalCosine)
            return true;
      }
      return false;
    };
    if (is_close()) continue;
    grid[c].push_back(kept.size());
    kept.push_back(p);
  }
  return kept;
}

std::vector<SurfacePoint> view_points(const World& world, const BakeView& view, const PixelRect& rect,
                                      int stride, bool skip_coarser) {
  const CameraRays camera(view.camera, view.width, view.height);
  std::vector<Ray> rays;
  for (int y = rect.y0; y < rect.y1; y += stride)
    for (int x = rect.x0; x < rect.x1; x += stride) {
      const bool coarser = (x - rect.x0) % (2 * stride) == 0 && (y - rect.y0) % (2 * stride) == 0;
      if (!(skip_coarser && coarser)) rays.push_back(camera.ray(x + 0.5, y + 0.5));
    }
  std::vector<Hit> hits(rays.size());
  world.tracer().intersect(rays, hits);
  std::vector<SurfacePoint> points;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!hits[i].is_hit() || is_black(world.material(hits[i]).albedo)) continue;
    const double footprint = kFootprintPixels * camera.pixel_angle() * hits[i].t;
    points.push_back(point_of(hits[i], hits[i].normal.dot(rays[i].direction) < 0, footprint));
  }
  return points;
}

}  // namespace brume
