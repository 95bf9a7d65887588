// Finds what rays hit. The only face of Embree, 3 or 4, in the program.
//
// Geometry is recentred in double before it becomes float, and hits are rebuilt in double from
// barycentrics, so a scene far from the origin answers like one at it (HARD_CASES N12, N14). The
// centre is where most vertices are, and triangles that are large beside their distance from it are
// cut up for Embree, so digits near it do not depend on how far some ground or stray triangle goes.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/math.h"
#include "geom/triangle_mesh.h"

namespace brume {

struct Hit {
  double t = kInfinity;  // Infinity: a miss, and nothing else is set.
  Vec3d position{0.0};
  Vec3d normal{0.0};  // Geometric, unit, on the counter-clockwise side whichever way the ray came.
  Vec3d shading_normal{
      0.0};           // Unit, interpolated where the mesh has normals, in normal's half space.
  double offset = 0;  // How far along the normal a new ray must start to clear this surface.
  std::uint32_t mesh = 0, triangle = 0, material = 0;

  bool is_hit() const { return t < kInfinity; }
  // Where a ray that leaves towards `direction` starts.
  Vec3d spawn(const Vec3d& direction) const {
    return position + normal * (normal.dot(direction) >= 0 ? offset : -offset);
  }
};

// A segment whose ends may see each other. `direction` is unit length, `t_end` may be infinite.
struct ShadowRay {
  Vec3d origin{0.0}, direction{0.0, 0.0, 1.0};
  double t_end = kInfinity;
};

// Immutable once built; all queries are thread-safe. A ray with a non-finite part, or a direction
// that is not of unit length, misses.
class RayTracer {
 public:
  // Meshes must be clean (remove_bad_triangles). Throws Error(Resource) when out of memory.
  explicit RayTracer(std::vector<TriangleMesh> meshes);
  ~RayTracer();
  RayTracer(RayTracer&&) noexcept;

  const std::vector<TriangleMesh>& meshes() const;
  // World box of all triangles; empty without any.
  const Box3d& bounds() const;
  // The median of the triangles' corners on each axis; 0 without any.
  const Vec3d& centre() const;
  // How far off its surface a ray from p must start to clear it, whatever the size of its triangle.
  double offset_at(const Vec3d& p) const;
  // One byte a library: name and version, for --version and image metadata.
  static std::string library_version();

  // Nearest hit with 0 < t < t_end.
  Hit intersect(const Ray& ray, double t_end = kInfinity) const;
  // Same for many rays, in packets of 8 (DESIGN 4.5); hits.size() == rays.size(). Which of two
  // triangles answers on their shared edge may differ from the call above, and depends on the rays
  // of the packet.
  void intersect(std::span<const Ray> rays, std::span<Hit> hits) const;

  // Whether anything that casts shadows lies strictly between origin and t_end. The last 1e-5 of
  // the way does not count, so that a ray may end on a light's surface.
  bool is_occluded(const ShadowRay& ray) const;
  // Same for many, in packets of 16; 1 where occluded.
  void is_occluded(std::span<const ShadowRay> rays, std::span<std::uint8_t> occluded) const;

  // Whether nothing, shadowless meshes included, lies between two points of surfaces, on their
  // sides of unit normals na and nb. Where one lies below the other's plane, as on a convex
  // surface, the way leads over what bulges between them.
  bool sees(const Vec3d& a, const Vec3d& na, const Vec3d& b, const Vec3d& nb) const;

  // The distance from p, a point of a surface, to the nearest that rises above its plane on the
  // side of the unit normal n; infinite where nothing does.
  double clearance(const Vec3d& p, const Vec3d& n) const;

  // A point of a triangle by barycentrics (b1, b2), as if a ray had hit it at t = 0.
  Hit point_on(std::uint32_t mesh, std::uint32_t triangle, const Vec2d& barycentrics) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace brume
