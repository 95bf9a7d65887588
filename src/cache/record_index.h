// Finds the records of one layer whose support may hold a point: an R-tree of sixteen-wide nodes,
// packed along a Hilbert curve, so that a million records are ready in tens of milliseconds.
#pragma once

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <array>
#include <bit>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "cache/record.h"
#include "core/math.h"

namespace brume {

// What a query must know of a record to tell whether it answers; 48 bytes, neighbours side by side.
struct RecordSite {
  float position[3];
  float normal[3];
  float tangent[3];  // Axis of radius[0]; that of radius[1] is normal x tangent.
  float radius[2];
  std::uint32_t record;  // Index into the cache's records.
};

class RecordIndex {
 public:
  RecordIndex() = default;
  // Of records [begin, end) of `records`; those with a fault are left out. Same tree for any number
  // of threads.
  RecordIndex(std::span<const SurfaceRecord> records, std::size_t begin, std::size_t end);
  // The same of sites that are made already, whose supports are boxes of half widths `halves`, by
  // site.
  RecordIndex(std::span<const RecordSite> sites, std::span<const std::array<float, 3>> halves);
  // `curve_order` must be such an index's own, of the same records: each of them once.
  RecordIndex(std::span<const SurfaceRecord> records, std::span<const std::uint32_t> curve_order);

  // Calls visit(site) for every site whose support, with radii of at least `min_radius`, may hold
  // `p` (relative to the cache's origin) and for some others, until it returns false. In no useful
  // order.
  template <typename Visit>
  void visit(const Vec3d& p, double min_radius, Visit&& visit) const;

  std::size_t size() const { return size_; }
  // Which records, along the curve; a tenth of the time to build the tree again.
  std::vector<std::uint32_t> curve_order() const;

 private:
  static constexpr std::uint32_t kWidth = 16;
  // The boxes of sixteen children. A support is the ellipsoid of the two radii and, along the
  // normal, the smaller; raising radii to m grows a box by at most m - least_radius.
  struct alignas(32) Node {
    float min[3][kWidth], max[3][kWidth];
    float least_radius[kWidth];
  };
  // Sites and their bounds of the records in `order`.
  template <typename MakeSite, typename MakeBounds>
  void build(std::span<const std::uint32_t> order, MakeSite&& make_site, MakeBounds&& make_bounds);
  // Bit i: `p` lies in child i's box, grown.
  static unsigned children_at(const Node& node, const float* p, float min_radius);

  // Shared between copies, as nothing changes them.
  std::shared_ptr<Node[]>
      nodes_;  // Level by level: child k of node i of a level is 16i + k below it.
  std::vector<std::uint32_t>
      levels_;  // Where each level starts in nodes_; level 0 holds the sites.
  std::shared_ptr<RecordSite[]> sites_;  // Along the curve.
  std::size_t size_ = 0;
  float least_radius_ = 0;  // Of all; queries below it need not grow boxes.
};

inline unsigned RecordIndex::children_at(const Node& node, const float* p, float min_radius) {
  // Vectors of four, which every compiler we build with and every machine has.
  typedef float Lanes __attribute__((vector_size(16)));
  typedef std::int32_t Mask __attribute__((vector_size(16)));
  unsigned inside = 0;
  for (std::uint32_t half = 0; half < kWidth; half += 4) {
    const auto lanes = [half](const float* values) {
      return *reinterpret_cast<const Lanes*>(values + half);
    };
    Lanes grow = {0, 0, 0, 0};
    if (min_radius > 0) {
      // A little more than what is lacking, for the rounding of p and of the sums.
      const Lanes lack = (min_radius - lanes(node.least_radius)) * 1.000002f;
      grow = lack > grow ? lack : grow;
    }
    const Mask in = (p[0] >= lanes(node.min[0]) - grow) & (p[0] <= lanes(node.max[0]) + grow) &
                    (p[1] >= lanes(node.min[1]) - grow) & (p[1] <= lanes(node.max[1]) + grow) &
                    (p[2] >= lanes(node.min[2]) - grow) & (p[2] <= lanes(node.max[2]) + grow);
#ifdef __SSE2__
    inside |= static_cast<unsigned>(_mm_movemask_ps(std::bit_cast<__m128>(in))) << half;
#else
    for (std::uint32_t i = 0; i < 4; ++i) inside |= static_cast<unsigned>(in[i] & 1) << (half + i);
#endif
  }
  return inside;
}

template <typename Visit>
void RecordIndex::visit(const Vec3d& point, double min_radius, Visit&& visit) const {
  if (size_ == 0 || !is_finite(point)) return;
  const float p[3] = {static_cast<float>(point.x), static_cast<float>(point.y),
                      static_cast<float>(point.z)};
  // Rounded up, so that the floats' growth covers the doubles' radii.
  const float m = min_radius > least_radius_ ? static_cast<float>(min_radius * 1.000001) : 0.0f;
  struct Entry {
    std::uint32_t level, node;
  };
  // A node adds at most fifteen entries to what it takes off, on each of at most eight levels (16^8
  // = 2^32).
  std::array<Entry, 8 * kWidth> stack;
  std::size_t depth = 0;
  stack[depth++] = {static_cast<std::uint32_t>(levels_.size() - 1), 0};
  while (depth > 0) {
    const Entry at = stack[--depth];
    unsigned inside = children_at(nodes_[levels_[at.level] + at.node], p, m);
    for (; inside != 0; inside &= inside - 1) {
      const std::uint32_t child =
          at.node * kWidth + static_cast<std::uint32_t>(__builtin_ctz(inside));
      if (at.level > 0) {
        stack[depth++] = {at.level - 1, child};
      } else if (child < size_ && !visit(sites_[child])) {
        return;
      }
    }
  }
}

}  // namespace brume
