#include "cache/record_index.h"

#include <limits>
#include <numeric>

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

// Bits of a 16-bit number moved two places apart.
std::uint64_t spread_bits(std::uint64_t x) {
  x = (x | x << 16) & 0x0000ff0000ffULL;
  x = (x | x << 8) & 0x00f00f00f00fULL;
  x = (x | x << 4) & 0x0c30c30c30c3ULL;
  return (x | x << 2) & 0x249249249249ULL;
}

struct Placed {
  std::uint64_t code;
  std::uint32_t site;
};

// Stable, by the 48 bits of `code`: least significant digit first.
void radix_sort(std::vector<Placed>& items) {
  constexpr int kDigitBits = 12, kCodeBits = 48;
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
  std::vector<std::uint32_t> sound;
  sound.reserve(end - begin);
  float low[3] = {kFar, kFar, kFar}, high[3] = {-kFar, -kFar, -kFar};
  for (std::size_t i = begin; i < end; ++i) {
    if (record_fault(records[i])) continue;
    sound.push_back(static_cast<std::uint32_t>(i));
    for (int a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], records[i].position[a]);
      high[a] = std::max(high[a], records[i].position[a]);
    }
  }
  if (sound.empty()) return;

  // One scale for all axes, so that cells of the curve are cubes.
  double extent = 0;
  for (int a = 0; a < 3; ++a) extent = std::max(extent, double(high[a]) - low[a]);
  const double scale = extent > 0 ? 65535 / extent : 0;
  std::vector<Placed> placed(sound.size());
  parallel_for(0, sound.size(), kGrain, [&](std::size_t i) {
    const float* p = records[sound[i]].position;
    std::uint64_t code = 0;
    for (int a = 0; a < 3; ++a)
      code |= spread_bits(static_cast<std::uint64_t>((double(p[a]) - low[a]) * scale)) << a;
    placed[i] = {code, sound[i]};
  });
  radix_sort(placed);

  sites_.resize(placed.size());
  std::vector<Bounds> below(placed.size());
  parallel_for(0, placed.size(), kGrain, [&](std::size_t i) {
    sites_[i] = make_site(records[placed[i].site], placed[i].site);
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
