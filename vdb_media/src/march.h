// What the marches of ray_marcher.h share.
#pragma once

#include "segments.h"
#include "vdb_media/ray_marcher.h"

namespace brume {

// All kernels give the same bits, so one the CPU lacks is replaced by the scalar one.
inline const SegmentKernel& choose_kernel(Simd simd) {
  const SegmentKernel* wide = simd == Simd::Scalar ? nullptr : avx512_kernel();
  return wide ? *wide : scalar_kernel();
}

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

inline void collect(const SegmentKernel& kernel, const Field& field, const Span* spans, int count,
                    const double* cuts, Segments& segments) {
  if (field.step_voxels > 0)
    collect_coarse(field, spans, count, cuts, segments);
  else
    kernel.collect(field, spans, count, cuts, segments);
}

inline Interval clip_homogeneous(const Volume& volume, const Ray& ray, Interval t) {
  const Box3d& b = volume.bounds;
  // clip() cannot know a box turned inside out.
  if (!(b.min.x < b.max.x && b.min.y < b.max.y && b.min.z < b.max.z)) return {0, 0};
  return clip(ray, b, t);
}

// tau += sigma_t * integral, where an endless path through nothing is nothing.
inline void add_depth(RgbD& tau, const RgbD& sigma_t, double integral) {
  for (int c = 0; c < 3; ++c)
    if (sigma_t[c] > 0) tau[c] += sigma_t[c] * integral;
}

}  // namespace brume
