#include "cache/record_index.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "cache/hilbert_curve.h"
#include "cache/large_pages.h"
#include "core/parallel.h"

namespace brume {
namespace {

constexpr std::size_t kGrain = 8192;

struct Bounds {
  float min[3], max[3], least_radius;
};
constexpr float kFar = std::numeric_limits<float>::infinity();
constexpr Bounds kNothing{{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}, kFar};

void extend(Bounds& bounds, const Bounds& other) {
  for (int a = 0; a < 3; ++a) {
    bounds.min[a] = std::min(bounds.min[a], other.min[a]);
    bounds.max[a] = std::max(bounds.max[a], other.max[a]);
  }
  bounds.least_radius = std::min(bounds.least_radius, other.least_radius);
}

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

RecordSite make_site(const SurfaceRecord& record, std::uint32_t index) {
  const Frame frame(vector(record.normal));
  Vec3d tangent = frame.u;
  // Round records need no axis, and are most of those of a cache without Hessians.
  if (record.axis != 0 && record.radius[0] != record.radius[1])
    tangent = frame.u * std::cos(double(record.axis)) + frame.v * std::sin(double(record.axis));
  RecordSite site;
  for (int a = 0; a < 3; ++a) {
    site.position[a] = record.position[a];
    site.normal[a] = record.normal[a];
    site.tangent[a] = static_cast<float>(tangent[a]);
  }
  site.radius[0] = record.radius[0];
  site.radius[1] = record.radius[1];
  site.record = index;
  return site;
}

// Padded: a query point is rounded to float before it is compared.
Bounds padded_box(const float* position, const Vec3d& halves, double least_radius) {
  Bounds bounds;
  bounds.least_radius = static_cast<float>(least_radius);
  for (int a = 0; a < 3; ++a) {
    const double half = halves[a], centre = position[a];
    const double pad = (std::abs(centre) + half) * 0x1p-20;
    bounds.min[a] = static_cast<float>(centre - half - pad);
    bounds.max[a] = static_cast<float>(centre + half + pad);
  }
  return bounds;
}

// The box of the ellipsoid with semi-axes R1 e1, R2 e2, min(R1, R2) n.
Bounds support_bounds(const RecordSite& site, std::uint32_t) {
  const double r1 = site.radius[0], r2 = site.radius[1], rn = std::min(r1, r2);
  Vec3d halves(rn);  // Of a sphere.
  if (r1 != r2) {
    const Vec3d n = vector(site.normal), e1 = vector(site.tangent), e2 = n.cross(e1);
    for (int a = 0; a < 3; ++a) halves[a] = Vec3d(r1 * e1[a], r2 * e2[a], rn * n[a]).length();
  }
  return padded_box(site.position, halves, rn);
}

constexpr int kBitsPerAxis = 16;

struct Placed {
  std::uint64_t code;  // Along the curve.
  std::uint32_t record;
};

// Stable, by `code`: least significant digit first.
void radix_sort(std::vector<Placed>& items) {
  constexpr int kDigitBits = 12, kCodeBits = 3 * kBitsPerAxis;
  constexpr std::size_t kDigits = std::size_t(1) << kDigitBits;
  std::vector<Placed> other(items.size());
  for (int shift = 0; shift < kCodeBits; shift += kDigitBits) {
    std::vector<std::uint32_t> start(kDigits, 0);
    for (const Placed& item : items) ++start[item.code >> shift & (kDigits - 1)];
    if (std::find(start.begin(), start.end(), items.size()) != start.end()) continue;
    std::exclusive_scan(start.begin(), start.end(), start.begin(), 0u);
    for (const Placed& item : items) other[start[item.code >> shift & (kDigits - 1)]++] = item;
    items.swap(other);
  }
}

// Along the curve, on one scale for all axes, so that its cells are cubes.
class Curve {
 public:
  Curve(const float* low, const float* high) {
    double extent = 0;
    for (int a = 0; a < 3; ++a) {
      low_[a] = low[a];
      extent = std::max(extent, double(high[a]) - low[a]);
    }
    scale_ = extent > 0 ? ((1 << kBitsPerAxis) - 1) / extent : 0;
  }
  std::uint64_t operator()(const float* position) const {
    std::array<std::uint32_t, 3> cell;
    for (std::size_t a = 0; a < 3; ++a)
      cell[a] = static_cast<std::uint32_t>((double(position[a]) - low_[a]) * scale_);
    return hilbert_index(cell, kBitsPerAxis);
  }

 private:
  double low_[3], scale_;
};

std::vector<std::uint32_t> along_curve(std::vector<Placed>& placed) {
  radix_sort(placed);
  std::vector<std::uint32_t> order(placed.size());
  for (std::size_t i = 0; i < placed.size(); ++i) order[i] = placed[i].record;
  return order;
}

// Makes sites of records. The curve's order is not the records': asks for the one of a few steps
// ahead.
auto site_of(std::span<const SurfaceRecord> records) {
  return [records](std::uint32_t i, std::uint32_t soon) {
    const char* next = reinterpret_cast<const char*>(&records[soon]);
    __builtin_prefetch(next);
    __builtin_prefetch(next + 64);
    return make_site(records[i], i);
  };
}

// Makes the first `count` of `boxes` the children of `node`; returns what they span.
template <typename Node>
Bounds fill(Node& node, const Bounds* boxes, std::size_t count) {
  constexpr std::size_t kLanes = std::size(Node{}.least_radius);
  Bounds all = kNothing;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const Bounds& box = lane < count ? boxes[lane] : kNothing;
    for (int a = 0; a < 3; ++a) {
      node.min[a][lane] = box.min[a];
      node.max[a][lane] = box.max[a];
    }
    node.least_radius[lane] = box.least_radius;
    extend(all, box);
  }
  return all;
}

}  // namespace

RecordIndex::RecordIndex(std::span<const SurfaceRecord> records, std::size_t begin,
                         std::size_t end) {
  // Pieces find what is sound and where it lies; least and most do not depend on who found them.
  constexpr std::size_t kPiece = 65536;
  struct Piece {
    float low[3] = {kFar, kFar, kFar}, high[3] = {-kFar, -kFar, -kFar};
    std::vector<std::uint32_t> sound;
    std::size_t first = 0;  // Sound records in the pieces before.
  };
  std::vector<Piece> pieces((end - begin + kPiece - 1) / kPiece);
  parallel_for(0, pieces.size(), 1, [&](std::size_t k) {
    Piece& piece = pieces[k];
    const std::size_t stop = std::min(end, begin + (k + 1) * kPiece);
    piece.sound.reserve(kPiece);
    for (std::size_t i = begin + k * kPiece; i < stop; ++i) {
      if (record_fault(records[i])) continue;
      piece.sound.push_back(static_cast<std::uint32_t>(i));
      for (int a = 0; a < 3; ++a) {
        piece.low[a] = std::min(piece.low[a], records[i].position[a]);
        piece.high[a] = std::max(piece.high[a], records[i].position[a]);
      }
    }
  });
  Piece all;
  for (Piece& piece : pieces) {
    piece.first = all.first;
    all.first += piece.sound.size();
    for (int a = 0; a < 3; ++a) {
      all.low[a] = std::min(all.low[a], piece.low[a]);
      all.high[a] = std::max(all.high[a], piece.high[a]);
    }
  }
  if (all.first == 0) return;

  std::vector<Placed> placed(all.first);
  const Curve curve(all.low, all.high);
  parallel_for(0, pieces.size(), 1, [&](std::size_t k) {
    std::size_t to = pieces[k].first;
    for (const std::uint32_t i : pieces[k].sound) placed[to++] = {curve(records[i].position), i};
  });
  build(along_curve(placed), site_of(records), support_bounds);
}

RecordIndex::RecordIndex(std::span<const RecordSite> sites,
                         std::span<const std::array<float, 3>> halves) {
  if (sites.empty()) return;
  float low[3] = {kFar, kFar, kFar}, high[3] = {-kFar, -kFar, -kFar};
  for (const RecordSite& site : sites)
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], site.position[a]);
      high[a] = std::max(high[a], site.position[a]);
    }
  std::vector<Placed> placed(sites.size());
  const Curve curve(low, high);
  for (std::uint32_t i = 0; i < sites.size(); ++i) placed[i] = {curve(sites[i].position), i};
  build(
      along_curve(placed), [&](std::uint32_t i, std::uint32_t) { return sites[i]; },
      [&](const RecordSite& site, std::uint32_t i) {
        const auto& half = halves[i];
        return padded_box(site.position, Vec3d(half[0], half[1], half[2]),
                          std::min({half[0], half[1], half[2]}));
      });
}

RecordIndex::RecordIndex(std::span<const SurfaceRecord> records,
                         std::span<const std::uint32_t> curve_order) {
  if (!curve_order.empty()) build(curve_order, site_of(records), support_bounds);
}

std::vector<std::uint32_t> RecordIndex::curve_order() const {
  std::vector<std::uint32_t> order(size_);
  for (std::size_t i = 0; i < size_; ++i) order[i] = sites_[i].record;
  return order;
}

template <typename MakeSite, typename MakeBounds>
void RecordIndex::build(std::span<const std::uint32_t> order, MakeSite&& make_site,
                        MakeBounds&& make_bounds) {
  size_ = order.size();
  sites_ = make_in_large_pages<RecordSite>(size_);
  std::size_t nodes = 0;
  for (std::size_t n = size_; n > 1 || nodes == 0; nodes += n) {
    n = (n + kWidth - 1) / kWidth;
    levels_.push_back(static_cast<std::uint32_t>(nodes));
  }
  nodes_ = make_in_large_pages<Node>(nodes);

  // Sites and the nodes right above them in one go, while both are at hand.
  std::vector<Bounds> below((size_ + kWidth - 1) / kWidth);
  parallel_for(0, below.size(), kGrain / kWidth, [&](std::size_t i) {
    const std::size_t end = std::min(size_, (i + 1) * kWidth);
    std::array<Bounds, kWidth> boxes;
    boxes.fill(kNothing);
    for (std::size_t k = i * kWidth; k < end; ++k) {
      sites_[k] = make_site(order[k], order[std::min(k + 12, size_ - 1)]);
      boxes[k % kWidth] = make_bounds(sites_[k], order[k]);
    }
    below[i] = fill(nodes_[i], boxes.data(), kWidth);
  });
  for (std::size_t level = 1; level < levels_.size(); ++level) {
    std::vector<Bounds> above((below.size() + kWidth - 1) / kWidth);
    parallel_for(0, above.size(), kGrain / kWidth, [&](std::size_t i) {
      above[i] = fill(nodes_[levels_[level] + i], &below[i * kWidth],
                      std::min<std::size_t>(kWidth, below.size() - i * kWidth));
    });
    below = std::move(above);
  }
  least_radius_ = below.front().least_radius;
}

}  // namespace brume
