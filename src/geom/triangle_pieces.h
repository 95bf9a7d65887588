// Triangles as a tracer in float takes them: large ones in pieces, so that digits near where most
// vertices are do not depend on how far some ground goes. Private to geom/.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/math.h"
#include "geom/triangle_mesh.h"

namespace brume {

// Where the corners of all triangles lie.
struct CornerSpread {
  Vec3d centre{0.0};        // Their median on each axis.
  double shortest_cut = 0;  // No edge below this is cut; 0: none is.
};
// O(corners). Of an even number the middle of two is taken, so that one rectangle has its own.
CornerSpread corner_spread(const std::vector<TriangleMesh>& meshes);

// A part of a triangle.
struct TrianglePiece {
  std::uint32_t triangle;
  std::array<Vec2d, 3> corners;  // In the triangle's barycentrics.
};

// Any piece that holds a point has its corners within so many times the larger of the point's
// distance from the centre and `shortest_cut`: of three edges around a point one is at least 3.4
// times as long as its distance from it.
inline constexpr double kMostReach = 9;

// All triangles of a mesh, in order, those with edges that are long beside their distance from the
// centre in pieces; empty where no triangle is cut. By edges alone, so that no ray passes between
// two pieces or neighbours.
std::vector<TrianglePiece> cut_large_triangles(const TriangleMesh& mesh,
                                               const CornerSpread& spread);

// The squared distance from the origin to the part of a triangle that rises more than `above` over
// the plane through the origin with unit normal n; infinite where none does.
double distance2_above(const Vec3d (&corner)[3], const Vec3d& n, double above);

}  // namespace brume
