// Triangles in world space, as every stage sees them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/math.h"

namespace brume {

struct TriangleMesh {
  std::string name;
  std::vector<Vec3d> positions;                         // World units.
  std::vector<std::array<std::uint32_t, 3>> triangles;  // Counter-clockwise seen from the front.
  std::vector<Vec3f> normals;            // One a position, or none: then surfaces are flat.
  std::vector<std::uint32_t> materials;  // One a triangle; an index whose meaning is the caller's.
  bool casts_shadow = true;              // Shadow rays only.
};

// Cleans a mesh in place: drops triangles with an index out of range, a non-finite corner or no
// area. Returns how many were dropped.
std::size_t remove_bad_triangles(TriangleMesh& mesh);

}  // namespace brume
