#include "geom/surface_area.h"

#include <algorithm>

#include "core/sampling.h"

namespace brume {

SurfaceArea::SurfaceArea(const RayTracer& tracer) : tracer_(tracer) {
  double area = 0;
  for (std::uint32_t m = 0; m < tracer.meshes().size(); ++m) {
    const TriangleMesh& mesh = tracer.meshes()[m];
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      const auto& [a, b, c] = mesh.triangles[t];
      const Vec3d edge = mesh.positions[b] - mesh.positions[a];
      area += edge.cross(mesh.positions[c] - mesh.positions[a]).length() / 2;
      triangles_.emplace_back(m, t);
      up_to_.push_back(area);
    }
  }
}

Hit SurfaceArea::point_of(std::size_t triangle, const Vec2d& u) const {
  const auto [mesh, index] = triangles_[std::min(triangle, triangles_.size() - 1)];
  return tracer_.point_on(mesh, index, sample_triangle(u));
}

Hit SurfaceArea::point(double part, const Vec2d& u) const {
  const auto found = std::upper_bound(up_to_.begin(), up_to_.end(), part * area());
  return point_of(static_cast<std::size_t>(found - up_to_.begin()), u);
}

Hit SurfaceArea::point_by_triangle(double part, const Vec2d& u) const {
  return point_of(static_cast<std::size_t>(part * double(triangles_.size())), u);
}

}  // namespace brume
