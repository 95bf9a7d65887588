#include "bake/placement.h"

#include <algorithm>
#include <limits>
#include <unordered_map>

#include "core/parallel.h"
#include "core/random.h"
#include "core/sampling.h"
#include "geom/surface_area.h"
#include "scene/camera_rays.h"

namespace brume {
namespace {

SurfacePoint point_of(const Hit& hit, bool front, double min_radius) {
  return {hit.position, front ? hit.shading_normal : -hit.shading_normal, hit.offset, min_radius};
}

}  // namespace

SurfacePatches::SurfacePatches(const RayTracer& tracer) : tracer_(tracer) {
  for (std::uint32_t m = 0; m < tracer.meshes().size(); ++m)
    for (std::uint32_t t = 0; t < tracer.meshes()[m].triangles.size(); ++t)
      for (const bool front : {true, false})
        open_.push_back({m, t, {Vec2d(0.0, 0.0), Vec2d(1.0, 0.0), Vec2d(0.0, 1.0)}, front});
}

SurfacePoint SurfacePatches::point(const Patch& patch, const Vec2d& at) const {
  const auto& [a, b, c] = patch.corners;
  return point_of(tracer_.point_on(patch.mesh, patch.triangle, a + (b - a) * at.x + (c - a) * at.y),
                  patch.front, 0);
}

// Of its longest edge, squared.
double SurfacePatches::size2(const Patch& patch, int* longest) const {
  const TriangleMesh& mesh = tracer_.meshes()[patch.mesh];
  const auto& [a, b, c] = mesh.triangles[patch.triangle];
  const Vec3d e1 = mesh.positions[b] - mesh.positions[a],
              e2 = mesh.positions[c] - mesh.positions[a];
  double most = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec2d d = patch.corners[(i + 1) % 3] - patch.corners[i];
    const double length2 = (e1 * d.x + e2 * d.y).length2();
    if (length2 <= most) continue;
    most = length2;
    if (longest) *longest = static_cast<int>(i);
  }
  return most;
}

double SurfacePatches::area(const Patch& patch) const {
  const TriangleMesh& mesh = tracer_.meshes()[patch.mesh];
  const auto& [a, b, c] = mesh.triangles[patch.triangle];
  const Vec3d e1 = mesh.positions[b] - mesh.positions[a],
              e2 = mesh.positions[c] - mesh.positions[a];
  const Vec2d u = patch.corners[1] - patch.corners[0], v = patch.corners[2] - patch.corners[0];
  return e1.cross(e2).length() / 2 * std::abs(u.x * v.y - u.y * v.x);
}

double SurfacePatches::largest() const {
  double most = 0;
  for (const Patch& patch : open_) most = std::max(most, size2(patch));
  return std::sqrt(most);
}

void SurfacePatches::split(double spacing, int threads,
                           const std::function<bool(const SurfacePoint&)>& is_covered) {
  std::vector<Patch> undecided = std::move(open_);
  open_.clear();
  while (!undecided.empty()) {
    std::vector<std::uint8_t> is_done(undecided.size());
    parallel_for(threads, undecided.size(), 64, [&](std::size_t i) {
      constexpr double kInside = 0.1;  // Off the corners, where other surfaces meet this one.
      static const Vec2d kTested[] = {{1 / 3.0, 1 / 3.0},
                                      {kInside / 2, kInside / 2},
                                      {1 - kInside, kInside / 2},
                                      {kInside / 2, 1 - kInside}};
      is_done[i] = std::all_of(std::begin(kTested), std::end(kTested), [&](const Vec2d& at) {
        return is_covered(point(undecided[i], at));
      });
    });
    std::vector<Patch> halves;
    for (std::size_t i = 0; i < undecided.size(); ++i) {
      if (is_done[i]) continue;
      int edge = 0;
      if (size2(undecided[i], &edge) <= spacing * spacing) {
        open_.push_back(undecided[i]);
        continue;
      }
      const auto first = static_cast<std::size_t>(edge), next = (first + 1) % 3;
      const Vec2d middle = (undecided[i].corners[first] + undecided[i].corners[next]) * 0.5;
      for (const std::size_t moved : {first, next}) {
        halves.push_back(undecided[i]);
        halves.back().corners[moved] = middle;
      }
    }
    undecided = std::move(halves);
  }
}

std::vector<SurfacePoint> SurfacePatches::points(double spacing, std::uint64_t seed) const {
  std::vector<SurfacePoint> points;
  RandomStream random(seed);
  double next = random.uniform(), running = 0;
  for (const Patch& patch : open_) {
    running += std::min(1.0, area(patch) / (spacing * spacing));
    if (running <= next) continue;
    next += 1;
    points.push_back(point(patch, sample_triangle(random.uniform2())));
  }
  return points;
}

std::vector<SurfacePoint> some_surface_points(const RayTracer& tracer, std::uint64_t seed) {
  constexpr std::size_t kEach = 512;
  const SurfaceArea surfaces(tracer);
  std::vector<SurfacePoint> points;
  if (!(surfaces.area() > 0)) return points;
  RandomStream random(seed);
  const auto add = [&](const Hit& hit) {
    points.push_back(point_of(hit, true, 0));
    points.push_back(point_of(hit, false, 0));
  };
  for (std::size_t i = 0; i < kEach; ++i) {
    const double at = (double(i) + random.uniform()) / kEach;
    add(surfaces.point(at, random.uniform2()));
    add(surfaces.point_by_triangle(at, random.uniform2()));
  }
  return points;
}

namespace {

// Points that have been kept. Distances asked about never grow, so that one grid of cubes at least
// twice as wide does, made anew where they have become much smaller: eight cubes hold whatever is
// near.
class KeptPoints {
 public:
  // Whether none kept before is as near as `distance`.
  bool is_free(const SurfacePoint& p, double distance) {
    const int level = static_cast<int>(std::ceil(std::log2(2 * distance)));
    if (level != level_) {
      level_ = level;
      cubes_.clear();
      for (const SurfacePoint* k : kept_) cubes_[cube_of(k->position)].push_back(k);
    }
    const Cube low = cube_of(p.position - Vec3d(distance));
    const Cube high = cube_of(p.position + Vec3d(distance));
    for (std::int64_t x = low[0]; x <= high[0]; ++x)
      for (std::int64_t y = low[1]; y <= high[1]; ++y)
        for (std::int64_t z = low[2]; z <= high[2]; ++z) {
          const auto found = cubes_.find({x, y, z});
          if (found == cubes_.end()) continue;
          for (const SurfacePoint* k : found->second)
            if ((k->position - p.position).length2() < distance * distance &&
                k->normal.dot(p.normal) > kMaxNormalCosine)
              return false;
        }
    return true;
  }
  // `p` must outlive this.
  void add(const SurfacePoint& p) {
    kept_.push_back(&p);
    cubes_[cube_of(p.position)].push_back(&p);
  }

 private:
  using Cube = std::array<std::int64_t, 3>;
  struct Hash {
    std::size_t operator()(const Cube& c) const { return random_key(c[0], c[1], c[2]); }
  };
  Cube cube_of(const Vec3d& p) const {
    Cube cube;
    for (int a = 0; a < 3; ++a)
      cube[static_cast<std::size_t>(a)] = static_cast<std::int64_t>(
          std::clamp(std::floor(std::ldexp(p[a], -level_)), -0x1p62, 0x1p62));
    return cube;
  }

  int level_ = std::numeric_limits<int>::max();  // Cubes are 2^level wide.
  std::vector<const SurfacePoint*> kept_;
  std::unordered_map<Cube, std::vector<const SurfacePoint*>, Hash> cubes_;
};

// Distances may not grow from point to point.
template <typename DistanceOf>
std::vector<SurfacePoint> thinned(const std::vector<SurfacePoint>& points,
                                  const DistanceOf& distance_of, std::size_t most) {
  KeptPoints kept;
  std::vector<SurfacePoint> result;
  for (const SurfacePoint& p : points) {
    if (result.size() == most) break;
    if (!kept.is_free(p, distance_of(p))) continue;
    kept.add(p);
    result.push_back(p);
  }
  return result;
}

}  // namespace

std::vector<SurfacePoint> thin(const std::vector<SurfacePoint>& points, double distance) {
  return thinned(
      points, [=](const SurfacePoint&) { return distance; }, points.size());
}

std::vector<SurfacePoint> thin_by_footprint(std::vector<SurfacePoint> points, double part,
                                            std::size_t most) {
  std::stable_sort(points.begin(), points.end(), [](const SurfacePoint& a, const SurfacePoint& b) {
    return a.min_radius > b.min_radius;
  });
  return thinned(
      points, [=](const SurfacePoint& p) { return part * p.min_radius; }, most);
}

std::vector<SurfacePoint> view_points(const World& world, const BakeView& view,
                                      const PixelRect& rect, int stride, bool skip_coarser) {
  const CameraRays camera(view.camera, kPointsPerPixel * view.width, kPointsPerPixel * view.height);
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
    const double footprint = kFootprintPixels * kPointsPerPixel * camera.pixel_angle() * hits[i].t;
    points.push_back(point_of(hits[i], hits[i].normal.dot(rays[i].direction) < 0, footprint));
  }
  return points;
}

}  // namespace brume
