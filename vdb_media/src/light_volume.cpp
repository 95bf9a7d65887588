#include "vdb_media/light_volume.h"

#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"
#include "vdb_media/brick_pyramid.h"
#include "vdb_media/depth_marcher.h"

namespace brume {
namespace {

// Test points: one in each of 12^3 boxes. They measure 0.5 % rms to about a seventh of itself.
constexpr int kTestsPerAxis = 12;
constexpr std::uint64_t kTestSeed = 0x4c56;

// Integral of density from the light to p.
double march_to_light(const Volume& volume, const LightOrigin& origin, const Vec3d& p) {
  MarchCounters unused;
  if (const auto* point = std::get_if<PointOrigin>(&origin)) {
    const Vec3d way = point->position - p;
    const double distance = way.length();
    if (!(distance > 0)) return 0;
    return density_integral(volume, {p, way / distance}, {0, distance}, {}, unused);
  }
  return density_integral(volume, {p, -std::get<DirectionOrigin>(origin).direction}, {0, kInfinity},
                          {}, unused);
}

// From points towards the light; at most DepthMarcher::kRays.
void march_to_light(const DepthMarcher& marcher, const LightOrigin& origin,
                    std::span<const Vec3d> points, float* integrals) {
  std::array<Ray, DepthMarcher::kRays> rays;
  std::array<double, DepthMarcher::kRays> ends{};
  for (std::size_t i = 0; i < points.size(); ++i) {
    rays[i].origin = points[i];
    if (const auto* point = std::get_if<PointOrigin>(&origin)) {
      const Vec3d way = point->position - points[i];
      ends[i] = way.length();
      if (ends[i] > 0) rays[i].direction = way / ends[i];
    } else {
      rays[i].direction = -std::get<DirectionOrigin>(origin).direction;
      ends[i] = kInfinity;
    }
  }
  const std::size_t n = points.size();
  marcher.march({rays.data(), n}, {ends.data(), n}, {integrals, n});
}

}  // namespace

LightVolume::LightVolume(const Volume& volume, const LightOrigin& origin,
                         const LightVolumeOptions& options) {
  Affine3d index_to_world;
  Vec3d resolution(1.0);  // Cells of the lattice where it is as fine as the volume.
  if (volume.is_homogeneous()) {
    box_index_ = volume.bounds;
    for (int a = 0; a < 3; ++a)
      if (!(std::isfinite(box_index_.min[a]) && std::isfinite(box_index_.max[a])))
        throw Error(ErrorKind::InvalidInput,
                    "light volume: the medium is unbounded: give it bounds or march instead");
    // Only the box's edges bend the depth, which any lattice has trouble with.
    resolution = Vec3d(64.0);
  } else {
    box_index_ = volume.density->index_bounds();
    index_to_world = volume.density->index_to_world();
    world_to_index_ = volume.density->world_to_index();
    for (int a = 0; a < 3; ++a)
      resolution[a] = std::max(1.0, box_index_.max[a] - box_index_.min[a]);
  }
  if (volume.is_empty() || box_index_.isEmpty()) {
    box_index_ = Box3d();
    return;
  }
  const Vec3d extent = box_index_.max - box_index_.min;
  std::optional<BrickPyramid> own;
  if (!options.pyramid && !volume.is_homogeneous()) own.emplace(volume.density);
  const BrickPyramid* pyramid = options.pyramid ? options.pyramid : own ? &*own : nullptr;

  std::vector<Vec3d> tests;
  std::vector<double> exact(kTestsPerAxis * kTestsPerAxis * kTestsPerAxis);
  RandomStream random(random_key(kTestSeed));
  for (int z = 0; z < kTestsPerAxis; ++z)
    for (int y = 0; y < kTestsPerAxis; ++y)
      for (int x = 0; x < kTestsPerAxis; ++x) {
        const double ux = random.uniform(), uy = random.uniform(), uz = random.uniform();
        const Vec3d u = (Vec3d(x, y, z) + Vec3d(ux, uy, uz)) / kTestsPerAxis;
        tests.push_back(index_to_world.point(box_index_.min + extent * u));
      }
  parallel_for(options.threads, tests.size(), 64,
               [&](std::size_t i) { exact[i] = march_to_light(volume, origin, tests[i]); });

  const RgbD sigma_t = volume.sigma_t();
  for (double coarseness = 4;; coarseness /= std::numbers::sqrt2) {
    std::uint64_t nodes = 1;
    Vec3i count;
    for (int a = 0; a < 3; ++a) {
      count[a] = std::max(2, int(std::ceil(resolution[a] / coarseness)) + 1);
      nodes *= std::uint64_t(count[a]);
    }
    // The coarsest one is made whatever the limit: something must stand.
    if (!values_.empty() && nodes * sizeof(float) > options.max_bytes) return;
    count_ = count;
    for (int a = 0; a < 3; ++a) nodes_per_index_[a] = (count[a] - 1) / extent[a];
    values_.assign(nodes, 0);
    std::optional<DepthMarcher> coarse;
    if (!volume.is_homogeneous() && coarseness > 1.01) {
      const double step = 0.5 * coarseness * volume.density->voxel_size();
      coarse.emplace(volume, *pyramid, step, step);
    }
    parallel_for(options.threads, std::size_t(count.y) * count.z, 4, [&](std::size_t row) {
      const int y = int(row % count.y), z = int(row / count.y);
      std::array<Vec3d, DepthMarcher::kRays> points;
      for (int first = 0; first < count.x; first += DepthMarcher::kRays) {
        const int n = std::min(DepthMarcher::kRays, count.x - first);
        float* values = &values_[row * count.x + first];
        for (int i = 0; i < n; ++i)
          points[std::size_t(i)] =
              index_to_world.point(box_index_.min + Vec3d(first + i, y, z) / nodes_per_index_);
        if (coarse)
          march_to_light(*coarse, origin, {points.data(), std::size_t(n)}, values);
        else
          for (int i = 0; i < n; ++i)
            values[i] = float(march_to_light(volume, origin, points[std::size_t(i)]));
      }
    });

    double squares = 0;
    max_error_ = 0;
    for (std::size_t i = 0; i < tests.size(); ++i) {
      const double found = density_integral(tests[i]);
      double error = 0;
      for (int c = 0; c < 3; ++c)
        error = std::max(
            error, std::abs(std::exp(-sigma_t[c] * found) - std::exp(-sigma_t[c] * exact[i])));
      squares += error * error;
      max_error_ = std::max(max_error_, error);
    }
    rms_error_ = std::sqrt(squares / double(tests.size()));
    if (rms_error_ <= options.target_error || coarseness < 1.01) return;
  }
}

bool LightVolume::covers(const Vec3d& p) const {
  const Vec3d q = world_to_index_.point(p);
  for (int a = 0; a < 3; ++a)
    if (!(q[a] >= box_index_.min[a] && q[a] <= box_index_.max[a])) return false;
  return true;
}

double LightVolume::density_integral(const Vec3d& p) const {
  if (values_.empty()) return 0;
  const Vec3d q = (world_to_index_.point(p) - box_index_.min) * nodes_per_index_;
  std::size_t cell[3];
  double f[3];
  for (int a = 0; a < 3; ++a) {
    const double held = std::clamp(q[a], 0.0, double(count_[a] - 1));
    cell[a] = std::min(std::size_t(held), std::size_t(count_[a] - 2));
    f[a] = held - double(cell[a]);
  }
  const std::size_t row = count_.x, slab = row * count_.y;
  const float* v = values_.data() + cell[2] * slab + cell[1] * row + cell[0];
  const auto along_x = [&](const float* c) { return c[0] + f[0] * (double(c[1]) - c[0]); };
  const auto along_xy = [&](const float* c) {
    const double low = along_x(c);
    return low + f[1] * (along_x(c + row) - low);
  };
  const double low = along_xy(v);
  return low + f[2] * (along_xy(v + slab) - low);
}

}  // namespace brume
