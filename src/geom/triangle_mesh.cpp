#include "geom/triangle_mesh.h"

namespace brume {
namespace {

// Twice the area below this share of the longest edge squared is rounding noise of collinear
// corners.
constexpr double kNoArea = 1e-14;

bool is_good(const TriangleMesh& mesh, const std::array<std::uint32_t, 3>& triangle) {
  for (const std::uint32_t i : triangle) {
    if (i >= mesh.positions.size() || !is_finite(mesh.positions[i])) return false;
  }
  const Vec3d& a = mesh.positions[triangle[0]];
  const Vec3d e1 = mesh.positions[triangle[1]] - a, e2 = mesh.positions[triangle[2]] - a;
  const double longest = std::max({e1.length2(), e2.length2(), (e2 - e1).length2()});
  const double area = e1.cross(e2).length();
  return std::isfinite(longest) && area > kNoArea * longest;
}

}  // namespace

std::size_t remove_bad_triangles(TriangleMesh& mesh) {
  const bool has_materials = mesh.materials.size() == mesh.triangles.size();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (!is_good(mesh, mesh.triangles[i])) continue;
    mesh.triangles[kept] = mesh.triangles[i];
    if (has_materials) mesh.materials[kept] = mesh.materials[i];
    ++kept;
  }
  const std::size_t dropped = mesh.triangles.size() - kept;
  mesh.triangles.resize(kept);
  if (has_materials) mesh.materials.resize(kept);
  return dropped;
}

}  // namespace brume
