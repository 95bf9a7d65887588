#include "cli/page_surfaces.h"

#include <algorithm>

namespace brume {
namespace {

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

// Records on the front and on the back of a triangle, or of a mesh.
struct Votes {
  std::size_t front = 0, back = 0;
  bool is_empty() const { return front + back == 0; }
  bool is_one_sided() const { return std::min(front, back) * 8 <= std::max(front, back); }
};

std::vector<std::vector<Votes>> count_votes(const World& world,
                                            std::span<const SurfaceRecord> records,
                                            const Vec3d& origin) {
  std::vector<std::vector<Votes>> votes;
  for (const TriangleMesh& mesh : world.tracer().meshes())
    votes.emplace_back(mesh.triangles.size());
  // Deeper bounces lie on both sides of everything; what eye rays ask lies where eyes are.
  int top = 0;
  for (const SurfaceRecord& record : records) top = std::max(top, record.layer());
  for (const SurfaceRecord& record : records) {
    if (record.layer() != top) continue;
    const Vec3d n = vector(record.normal).normalized();
    const double lift = 1e-4 * world.diagonal();
    const Hit hit =
        world.tracer().intersect({origin + vector(record.position) + n * lift, -n}, 2 * lift);
    // Lamps are black, and what lies on them is an accident of placing.
    if (!hit.is_hit() || is_black(world.material(hit).albedo)) continue;
    Votes& of_triangle = votes[hit.mesh][hit.triangle];
    ++(hit.normal.dot(n) > 0 ? of_triangle.front : of_triangle.back);
  }
  return votes;
}

}  // namespace

PageSurfaces page_surfaces(const World& world, std::span<const SurfaceRecord> records,
                           const Vec3d& origin, const Vec3d& centre) {
  PageSurfaces surfaces;
  const auto votes = count_votes(world, records, origin);
  for (std::size_t m = 0; m < votes.size(); ++m) {
    const TriangleMesh& mesh = world.tracer().meshes()[m];
    Votes of_mesh;
    for (const Votes& v : votes[m]) {
      of_mesh.front += v.front;
      of_mesh.back += v.back;
    }
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const Votes& side = votes[m][t].is_empty() ? of_mesh : votes[m][t];
      const bool is_turned = !side.is_empty() && side.is_one_sided();
      auto [a, b, c] = mesh.triangles[t];
      if (is_turned && side.back > side.front) std::swap(b, c);
      std::vector<float>& target = is_turned ? surfaces.turned : surfaces.two_sided;
      for (const std::uint32_t corner : {a, b, c}) {
        const Vec3d p = mesh.positions[corner] - centre;
        for (int axis = 0; axis < 3; ++axis) target.push_back(static_cast<float>(p[axis]));
      }
    }
  }
  return surfaces;
}

}  // namespace brume
