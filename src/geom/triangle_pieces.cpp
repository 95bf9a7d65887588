#include "geom/triangle_pieces.h"

#include <algorithm>

namespace brume {
namespace {

// Triangles whose edges are longer than this many distances from the centre are cut, but none below
// so many times the median distance of all corners.
constexpr double kLongestEdge = 1, kShortestCut = 4;

// Of an edge alone, so that both triangles at it are cut alike and no ray passes between them.
bool is_long(const Vec3d& a, const Vec3d& b, const CornerSpread& spread) {
  const Vec3d edge = b - a;
  const double length2 = edge.length2();
  if (!(length2 > spread.shortest_cut * spread.shortest_cut)) return false;
  const Vec3d nearest = a + edge * std::clamp((spread.centre - a).dot(edge) / length2, 0.0, 1.0);
  return length2 > kLongestEdge * kLongestEdge * (nearest - spread.centre).length2();
}

void cut(const Vec3d (&corner)[3], const TrianglePiece& whole, const CornerSpread& spread,
         std::vector<TrianglePiece>& to) {
  int longest = -1;
  double most = 0;
  for (int i = 0; i < 3; ++i) {
    const Vec3d &a = corner[i], &b = corner[(i + 1) % 3];
    const double length2 = (b - a).length2();
    if (length2 > most && is_long(a, b, spread)) {
      most = length2;
      longest = i;
    }
  }
  if (longest < 0) {
    to.push_back(whole);
    return;
  }
  const int next = (longest + 1) % 3;
  const Vec3d middle = (corner[longest] + corner[next]) * 0.5;
  const Vec2d at = (whole.corners[longest] + whole.corners[next]) * 0.5;
  for (const int moved : {longest, next}) {
    Vec3d part[3] = {corner[0], corner[1], corner[2]};
    TrianglePiece piece = whole;
    part[moved] = middle;
    piece.corners[static_cast<std::size_t>(moved)] = at;
    cut(part, piece, spread, to);
  }
}

}  // namespace

CornerSpread corner_spread(const std::vector<TriangleMesh>& meshes) {
  CornerSpread spread;
  std::vector<double> values;
  const auto median_of = [&](const auto& value) {
    values.clear();
    for (const TriangleMesh& mesh : meshes)
      for (const auto& triangle : mesh.triangles)
        for (const std::uint32_t i : triangle) values.push_back(value(mesh.positions[i]));
    // Of an even number the middle of two, so that one rectangle has its own.
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    if (values.size() % 2 == 1) return *middle;
    return (*middle + *std::max_element(values.begin(), middle)) / 2;
  };
  for (int a = 0; a < 3; ++a) spread.centre[a] = median_of([a](const Vec3d& p) { return p[a]; });
  spread.shortest_cut = kShortestCut * median_of([&](const Vec3d& p) {
                          const Vec3d d = p - spread.centre;
                          return std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)});
                        });
  return spread;
}

std::vector<TrianglePiece> cut_large_triangles(const TriangleMesh& mesh,
                                               const CornerSpread& spread) {
  std::vector<TrianglePiece> all;
  if (!(spread.shortest_cut > 0)) return all;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& i = mesh.triangles[t];
    const Vec3d corner[3] = {mesh.positions[i[0]], mesh.positions[i[1]], mesh.positions[i[2]]};
    cut(corner, {t, {Vec2d(0.0, 0.0), Vec2d(1.0, 0.0), Vec2d(0.0, 1.0)}}, spread, all);
  }
  if (all.size() == mesh.triangles.size()) all.clear();
  return all;
}

double distance2_above(const Vec3d (&corner)[3], const Vec3d& n, double above) {
  Vec3d part[4];
  int count = 0;
  for (int k = 0; k < 3; ++k) {
    const Vec3d &a = corner[k], &b = corner[(k + 1) % 3];
    const double ha = n.dot(a) - above, hb = n.dot(b) - above;
    if (ha > 0) part[count++] = a;
    if ((ha > 0) != (hb > 0)) part[count++] = a + (b - a) * (ha / (ha - hb));
  }
  if (count < 3) return kInfinity;
  double least2 = kInfinity;
  for (int k = 0; k < count; ++k) {
    const Vec3d &a = part[k], edge = part[(k + 1) % count] - a;
    const double length2 = edge.length2();
    const double at = length2 > 0 ? std::clamp(-a.dot(edge) / length2, 0.0, 1.0) : 0;
    least2 = std::min(least2, (a + edge * at).length2());
  }
  // Nearer than its edges only where p lies over it.
  const Vec3d cross = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
  const double area2 = cross.length2();
  if (!(area2 > 0)) return least2;
  const Vec3d foot = cross * (cross.dot(corner[0]) / area2);
  if (!(n.dot(foot) > above)) return least2;
  for (int k = 0; k < 3; ++k)
    if ((corner[(k + 1) % 3] - corner[k]).cross(foot - corner[k]).dot(cross) < 0) return least2;
  return std::min(least2, foot.length2());
}

}  // namespace brume
