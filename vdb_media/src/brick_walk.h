// Which bricks a ray meets, in order: the coarse half of every march.
//
// A ray is moved to index space once. Its parameter stays a distance in world units there, so a map
// of any kind, mirrored or sheared, needs no further factor. All crossings, of cells and of bricks
// alike, are `plane(axis, integer)`: a pure function of the ray, never a running sum, so that
// nothing drifts and whoever asks for a crossing gets the same bits.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "core/math.h"
#include "vdb_media/brick_grid.h"

namespace brume {

struct IndexRay {
  std::array<double, 3> origin{}, direction{}, inverse{};
  // Parameters here are `base` less than along the world's ray: an origin a million voxels away
  // would cost the fractions within a cell their digits.
  double base = 0;

  bool is_parallel(int axis) const { return direction[axis] == 0; }
  // Not for parallel axes.
  double plane(int axis, double p) const { return (p - origin[axis]) * inverse[axis]; }
  double at(int axis, double t) const { return origin[axis] + direction[axis] * t; }
  // Voxels passed per world unit.
  double speed() const {
    return std::sqrt(direction[0] * direction[0] + direction[1] * direction[1] +
                     direction[2] * direction[2]);
  }
};

// A ray in a grid's index space, and the part of an interval where the field can be; in parameters
// of the IndexRay.
struct Entry {
  IndexRay ray;
  double begin = 0, end = 0;
};

// Nothing where the ray misses the grid. Half-open: a ray along the lower face is inside.
inline std::optional<Entry> enter(const BrickGrid& grid, const Ray& world, Interval t) {
  if (grid.is_empty() || t.is_empty()) return std::nullopt;
  const Box3d& box = grid.index_bounds();
  const Vec3d o = grid.world_to_index().point(world.origin);
  const Vec3d d = grid.world_to_index().vector(world.direction);
  if (!is_finite(o) || !is_finite(d)) return std::nullopt;
  Entry e;
  const auto clip = [&](double begin, double end) {
    for (int a = 0; a < 3; ++a) {
      if (e.ray.is_parallel(a)) {
        if (!(e.ray.origin[a] >= box.min[a] && e.ray.origin[a] < box.max[a])) return false;
        continue;
      }
      const double lower = e.ray.plane(a, box.min[a]), upper = e.ray.plane(a, box.max[a]);
      begin = std::max(begin, std::min(lower, upper));
      end = std::min(end, std::max(lower, upper));
    }
    e.begin = begin;
    e.end = end;
    return begin < end && std::isfinite(begin) && std::isfinite(end);
  };
  for (int a = 0; a < 3; ++a) {
    e.ray.origin[a] = o[a];
    // Below, the inverse would overflow and 0 * inf be NaN. The box is crossed long before such an
    // axis has moved.
    e.ray.direction[a] = std::abs(d[a]) < 1e-300 ? 0 : d[a];
    e.ray.inverse[a] = e.ray.is_parallel(a) ? 0 : 1 / d[a];
  }
  if (!clip(-kInfinity, kInfinity)) return std::nullopt;
  // Chosen from the ray alone, so that the parts of a split interval agree to the last bit.
  if (e.begin > 0) {
    e.ray.base = e.begin;
    for (int a = 0; a < 3; ++a) e.ray.origin[a] += e.ray.direction[a] * e.ray.base;
  }
  if (!clip(t.begin - e.ray.base, t.end - e.ray.base)) return std::nullopt;
  return e;
}

// Calls visit(top entry, first cell of the brick in index space, begin, end) for each brick or tile
// that is not empty, in order along the ray. Ends after at most the sum of brick_count() steps.
template <typename Visit>
void walk_bricks(const BrickGrid& grid, const Entry& entry, Visit&& visit) {
  constexpr int kCells = BrickGrid::kCells;
  const IndexRay& ray = entry.ray;
  const Vec3i first = grid.brick_min(), count = grid.brick_count();
  Vec3i brick;
  std::array<double, 3> next;     // Where the ray leaves the brick, by axis.
  std::array<int, 3> step, left;  // `left`: bricks ahead in the grid.
  for (int a = 0; a < 3; ++a) {
    const double p = ray.at(a, entry.begin) / kCells - first[a];
    step[a] = ray.is_parallel(a) ? 0 : ray.direction[a] < 0 ? -1 : 1;
    const double cell = step[a] < 0 ? std::ceil(p) - 1 : std::floor(p);
    brick[a] = int(std::clamp(cell, 0.0, double(count[a] - 1)));
    next[a] = kInfinity;
    left[a] = 0;
    if (step[a] == 0) continue;
    const auto exit_of = [&](int b) {
      return ray.plane(a, double(kCells) * (first[a] + b + (step[a] > 0 ? 1 : 0)));
    };
    // Rounding may put `begin` on the other side of a plane than the plane's own crossing says.
    while (brick[a] - step[a] >= 0 && brick[a] - step[a] < count[a] &&
           exit_of(brick[a] - step[a]) > entry.begin)
      brick[a] -= step[a];
    while ((next[a] = exit_of(brick[a])) <= entry.begin) {
      brick[a] += step[a];
      if (brick[a] < 0 || brick[a] >= count[a]) return;
    }
    left[a] = step[a] > 0 ? count[a] - 1 - brick[a] : brick[a];
  }
  double t = entry.begin;
  while (true) {
    // Which axis is next is anybody's guess, so no branch is taken on it.
    int axis = next[1] < next[0];
    axis = next[2] < next[axis] ? 2 : axis;
    const double out = std::min(next[axis], entry.end);
    if (out > t) {
      const std::int32_t top = grid.top(brick);
      if (top != BrickGrid::kEmpty) visit(top, (first + brick) * kCells, t, out);
      t = out;
    }
    if (!(next[axis] < entry.end) || left[axis]-- == 0) return;
    brick[axis] += step[axis];
    next[axis] = ray.plane(axis, double(kCells) * (first[axis] + brick[axis] + (step[axis] > 0)));
  }
}

}  // namespace brume
