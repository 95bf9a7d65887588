// What the marches of ray_marcher.h share.
#pragma once

#include <cmath>

#include "segments.h"
#include "vdb_media/ray_marcher.h"

namespace brume {

inline Field make_field(const BrickGrid& grid, const IndexRay& ray, const MarchOptions& options) {
  // Read for the segments of tiles where a grid has no bricks at all.
  static constexpr std::array<float, BrickGrid::kBrickFloats> kZeros{};
  return {grid.stored_brick_count() > 0 ? grid.brick(0) : kZeros.data(), ray,
          options.step_voxels > 1 ? options.step_voxels : 0};
}

inline Span make_span(const BrickGrid& grid, std::int32_t top, const Vec3i& corner, double begin,
                      double end) {
  Span span{begin, end, {double(corner.x), double(corner.y), double(corner.z)}};
  if (top < 0)
    span.tile = grid.tile(top);
  else
    span.offset = std::int64_t{top} * BrickGrid::kBrickFloats;
  return span;
}

inline Interval clip_homogeneous(const Volume& volume, const Ray& ray, Interval t) {
  const Box3d& b = volume.bounds;
  // clip() cannot know a box turned inside out.
  if (!(b.min.x < b.max.x && b.min.y < b.max.y && b.min.z < b.max.z)) return {0, 0};
  return clip(ray, b, t);
}

// The part of a shell's depth x that lies before a place drawn in proportion to transmittance:
// -log(1 - u (1 - exp(-x))) / x.
inline double draw_depth_fraction(double u, double x) {
  if (x > 0.3) return std::min(1.0, -std::log1p(u * std::expm1(-x)) / x);
  // Most shells are thin and the two functions are dear. This is the cumulant generating function
  // of a coin that falls heads with probability u; six cumulants are good to 2e-8 here.
  const double v = u * (1 - u), skew = v * (1 - 2 * u);
  const double k4 = v * (1 - 6 * v), k5 = skew * (1 - 12 * v), k6 = v * (1 + v * (120 * v - 30));
  return u - x * (v / 2 - x * (skew / 6 - x * (k4 / 24 - x * (k5 / 120 - x * (k6 / 720)))));
}

// tau += sigma_t * integral, where an endless path through nothing is nothing.
inline void add_depth(RgbD& tau, const RgbD& sigma_t, double integral) {
  for (int c = 0; c < 3; ++c)
    if (sigma_t[c] > 0) tau[c] += sigma_t[c] * integral;
}

}  // namespace brume
