#include "exchange/splat.h"

#include <algorithm>
#include <array>
#include <map>

#include "core/error.h"
#include "vdb_media/point_writer.h"

namespace brume {
namespace {

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

struct Sums {
  RgbD light;  // Weighted.
  double weight = 0;
  std::size_t count = 0;
};
// Ordered, so that the file depends on nothing else.
using Voxels = std::map<std::array<int, 3>, Sums>;

struct Disc {
  Vec3d centre, normal, along, across;
  double radius[2];

  Disc(const SurfaceRecord& record, const Vec3d& origin)
      : centre(origin + vector(record.position)), normal(vector(record.normal)) {
    const Frame frame(normal);
    along = frame.u * std::cos(double(record.axis)) + frame.v * std::sin(double(record.axis));
    across = normal.cross(along);
    radius[0] = record.radius[0];
    radius[1] = record.radius[1];
  }
  // Half the size of its box along an axis.
  double reach(int a) const { return std::hypot(radius[0] * along[a], radius[1] * across[a]); }
};

RgbD carried(const SurfaceRecord& record, const Vec3d& d) {
  RgbD e;
  for (int c = 0; c < 3; ++c)
    e[c] = std::clamp(record.irradiance[c] + vector(record.gradient + 3 * c).dot(d), 0.0,
                      2 * double(record.irradiance[c]));
  return e;
}

void splat(const SurfaceRecord& record, const Vec3d& origin, double h, Voxels& voxels) {
  const Disc disc(record, origin);
  const auto add = [&](const std::array<int, 3>& at, double weight, const Vec3d& d) {
    Sums& sums = voxels[at];
    sums.light += carried(record, d) * weight;
    sums.weight += weight;
    ++sums.count;
  };
  std::array<int, 3> low, high, own;
  // A plane crosses a cube where its distance from the centre is at most this.
  double half_width = 0;
  for (int a = 0; a < 3; ++a) {
    const auto i = static_cast<std::size_t>(a);
    own[i] = static_cast<int>(std::lround(disc.centre[a] / h));
    low[i] = static_cast<int>(std::floor((disc.centre[a] - disc.reach(a)) / h - 0.5));
    high[i] = static_cast<int>(std::ceil((disc.centre[a] + disc.reach(a)) / h + 0.5));
    half_width += 0.5 * h * std::abs(disc.normal[a]);
  }
  add(own, 1, Vec3d(0.0));
  std::array<int, 3> at;
  for (at[2] = low[2]; at[2] <= high[2]; ++at[2])
    for (at[1] = low[1]; at[1] <= high[1]; ++at[1])
      for (at[0] = low[0]; at[0] <= high[0]; ++at[0]) {
        if (at == own) continue;
        const Vec3d to_voxel = Vec3d(at[0], at[1], at[2]) * h - disc.centre;
        const double off = to_voxel.dot(disc.normal);
        if (std::abs(off) > half_width) continue;
        const Vec3d d = to_voxel - disc.normal * off;
        const double weight =
            1 - std::hypot(d.dot(disc.along) / disc.radius[0], d.dot(disc.across) / disc.radius[1]);
        if (weight > 0) add(at, weight, d);
      }
}

// Voxels that the boxes of all discs hold, more or less: what the loops above visit.
void check_size(const std::filesystem::path& file, const CacheContents& contents,
                const SplatOptions& options) {
  constexpr double kLargestIndex = 1 << 30;
  double visited = 0;
  for (const SurfaceRecord& record : contents.records) {
    const Disc disc(record, contents.header.origin);
    double box = 1;
    for (int a = 0; a < 3; ++a) {
      box *= 2 * disc.reach(a) / options.voxel_size + 3;
      if (!(std::abs(disc.centre[a]) + disc.reach(a) < kLargestIndex * options.voxel_size))
        visited = kInfinity;
    }
    visited += box;
  }
  if (visited > options.max_visited_voxels)
    throw Error(ErrorKind::InvalidInput,
                printable(file.string()) +
                    ": voxels of this size are too many for these records: "
                    "use a larger --voxel, or fewer records");
}

}  // namespace

SplatResult write_splat(const std::filesystem::path& file, const CacheContents& contents,
                        const SplatOptions& options) {
  check_size(file, contents, options);
  Voxels voxels;
  for (const SurfaceRecord& record : contents.records)
    splat(record, contents.header.origin, options.voxel_size, voxels);
  std::vector<Vec3i> places;
  std::vector<Vec3f> irradiance;
  std::vector<float> weight, count;
  for (const auto& [at, sums] : voxels) {
    places.emplace_back(at[0], at[1], at[2]);
    const RgbD mean = sums.light / sums.weight;
    irradiance.emplace_back(static_cast<float>(mean.r), static_cast<float>(mean.g),
                            static_cast<float>(mean.b));
    weight.push_back(static_cast<float>(sums.weight));
    count.push_back(static_cast<float>(sums.count));
  }
  write_voxels(file, {{"irradiance", options.voxel_size, places, std::move(irradiance)},
                      {"weight", options.voxel_size, places, std::move(weight)},
                      {"count", options.voxel_size, places, std::move(count)}});
  return {places.size()};
}

}  // namespace brume
