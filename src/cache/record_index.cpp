#include "cache/record_index.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "cache/hilbert_curve.h"
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

// The box of the ellipsoid with semi-axes R1 e1, R2 e2, min(R1, R2) n, padded: a query point is rounded
// to float before it is compared.
Bounds support_bounds(const RecordSite& site) {
  const Vec3d n = vector(site.normal), e1 = vector(site.tangent), e2 = n.cross(e1);
  const double r1 = site.radius[0], r2 = site.radius[1], rn = std::min(r1, r2);
  Bounds bounds;
  bounds.least_radius = static_cast<float>(rn);
  for (int a = 0; a < 3; ++a) {
    const double x = r1 * e1[a], y = r2 * e2[a], z = rn * n[a];
    const double half = std::sqrt(x * x + y * y + z * z), centre = site.position[a];
    const double pad = (std::abs(centre) + half) * 0x1p-20;
    bounds.min[a] = static_cast<float>(centre - half - pad);
    bounds.max[a] = static_cast<float>(centre + half + pad);
  }
  return bounds;
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

}  // namespace

RecordIndex::RecordIndex(std::span<const SurfaceRecord> records, std::size_t begin, std::size_t end) {
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

  // One scale for all axes, so that cells of the curve are cubes.
  double extent = 0;
  for (int a = 0; a < 3; ++a) extent = std::max(extent, double(all.high[a]) - all.low[a]);
  const double scale = extent > 0 ? ((1 << kBitsPerAxis) - 1) / extent : 0;
  std::vector<Placed> placed(all.first);
  parallel_for(0, pieces.size(), 1, [&](std::size_t k) {
    std::size_t to = pieces[k].first;
    for (const std::uint32_t i : pieces[k].sound) {
      std::array<std::uint32_t, 3> cell;
      for (std::size_t a = 0; a < 3; ++a)
        cell[a] =
            static_cast<std::uint32_t>((double(records[i].position[a]) - all.low[a]) * scale);
      placed[to++] = {hilbert_index(cell, kBitsPerAxis), i};
    }
  });
  radix_sort(placed);

  sites_.resize(placed.size());
  std::vector<Bounds> below(placed.size());
  parallel_for(0, placed.size(), kGrain, [&](std::size_t i) {
    // The curve's order is not the records': ask for those of a few steps ahead.
    const std::size_t ahead = std::min(i + 12, placed.size() - 1);
    const char* next = reinterpret_cast<const char*>(&records[placed[ahead].record]);
    __builtin_prefetch(next);
    __builtin_prefetch(next + 64);
    sites_[i] = make_site(records[placed[i].record], placed[i].record);
    below[i] = support_bounds(sites_[i]);
  });

  do {
    const std::size_t count = (below.size() + kWidth - 1) / kWidth, first = nodes_.size();
    levels_.push_back(static_cast<std::uint32_t>(first));
    nodes_.resize(first + count);
    std::vector<Bounds> level(count, kNothing);
    parallel_for(0, count, kGrain / kWidth, [&](std::size_t i) {
      Node& node = nodes_[first + i];
      for (std::size_t lane = 0; lane < kWidth; ++lane) {
        const std::size_t child = i * kWidth + lane;
        const Bounds& box = child < below.size() ? below[child] : kNothing;
        for (int a = 0; a < 3; ++a) {
          node.min[a][lane] = box.min[a];
          node.max[a][lane] = box.max[a];
        }
        node.least_radius[lane] = box.least_radius;
        extend(level[i], box);
      }
    });
    below = std::move(level);
  } while (below.size() > 1);
  least_radius_ = below.front().least_radius;
}

}  // namespace brume
