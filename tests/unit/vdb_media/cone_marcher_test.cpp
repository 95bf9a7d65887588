#include "vdb_media/cone_marcher.h"

#include <gtest/gtest.h>

#include "unit/vdb_media/march_cases.h"

namespace brume {
namespace {

using namespace march_cases;

double sum_of_nodes(const BrickGrid& grid) {
  double sum = 0;
  const Vec3i first = grid.brick_min() * BrickGrid::kCells;
  const Vec3i count = grid.brick_count() * BrickGrid::kCells;
  for (int z = 0; z <= count.z; ++z)
    for (int y = 0; y <= count.y; ++y)
      for (int x = 0; x <= count.x; ++x) sum += grid.sample(Vec3d(first + Vec3i(x, y, z)));
  return sum;
}

TEST(BrickPyramid, LevelsKeepTheIntegralAndTheRange) {
  const auto grid = make_lumps(crooked_map());
  const BrickPyramid pyramid(grid);
  ASSERT_GE(pyramid.level_count(), 3);
  const double all = sum_of_nodes(*grid);
  double share = 1;
  for (int l = 1; l < pyramid.level_count(); ++l) {
    share /= 8;
    EXPECT_NEAR(sum_of_nodes(pyramid.level(l)), all * share, 1e-5 * all * share) << l;
    EXPECT_LE(pyramid.level(l).range().max, pyramid.level(l - 1).range().max);
    EXPECT_NEAR(pyramid.level(l).voxel_size(), grid->voxel_size() * (1 << l), 1e-12);
  }
  for (int a = 0; a < 3; ++a) {
    EXPECT_LE(pyramid.level(pyramid.level_count() - 1).brick_count()[a], 2);
  }
}

TEST(BrickPyramid, ALinearFieldStaysWhereItIs) {
  const Affine3d map = scaling({0.1, 0.2, 0.15}, {1, -2, 3});
  const auto linear = [](const Vec3d& p) { return 4 + 0.3 * p.x - 0.2 * p.y + 0.1 * p.z; };
  const BrickPyramid pyramid(make_grid({-5, 2, 7}, Vec3i(64), map, linear));
  for (int l = 1; l < 3; ++l)
    for (const Vec3d& p : {Vec3d(3.4, 3.3, 8.1), Vec3d(2.1, 4.2, 7.7)}) {
      const BrickGrid& level = pyramid.level(l);
      const auto g = level.sample_gradient(level.world_to_index().point(p));
      EXPECT_NEAR(g.value, linear(p), 1e-5) << l;
      const Vec3d slope = level.world_to_index().transposed_vector(g.gradient);
      EXPECT_LT((slope - Vec3d(0.3, -0.2, 0.1)).length(), 1e-4) << l;
    }
}

TEST(BrickPyramid, AnEmptyGridHasOneLevel) {
  const BrickPyramid pyramid(make_grid(Vec3i(0), Vec3i(9), {}, [](const Vec3d&) { return 0; }));
  EXPECT_EQ(pyramid.level_count(), 1);
  EXPECT_EQ(pyramid.level_for(100), 0);
}

std::vector<double> shells_to(double end, int n) {
  std::vector<double> b;
  for (int i = 0; i <= n; ++i) b.push_back(end * i / n);
  return b;
}

// Means over even offsets of what a cone along one ray holds.
struct Means {
  std::vector<double> depth;  // To the start of each shell, and to the end.
  Vec3d i0{0.0}, i1{0.0};
  double transmittance = 0;
  std::uint64_t segments = 0;
};
Means over_offsets(const Medium& medium, const Ray& ray, const std::vector<double>& shells,
                   double t_end, double width, int offsets) {
  ConeMarcher marcher(medium);
  marcher.begin(ray.origin, shells, width);
  const std::vector<double> jitter(shells.size(), 0.5);
  Means m;
  m.depth.assign(shells.size(), 0);
  MarchCounters counters;
  for (int k = 0; k < offsets; ++k) {
    marcher.march(ray.direction, t_end, (k + 0.5) / offsets, jitter, true, counters);
    const int n = marcher.shell_count();
    for (int s = 0; s <= n; ++s) m.depth[static_cast<std::size_t>(s)] += marcher.tau(s).r / offsets;
    m.transmittance += std::exp(-marcher.tau(n).r) / offsets;
    m.i0 += marcher.grad_integral(0, n) / offsets;
    m.i1 += marcher.grad_moment(0, n) / offsets;
  }
  m.segments = counters.segments / static_cast<std::uint64_t>(offsets);
  return m;
}

// As fine as voxels, the mean over offsets is what marching cell by cell finds.
TEST(ConeMarcher, FineConesHoldWhatCellsHold) {
  const Volume lumps = make_volume(make_lumps(crooked_map())),
               box = make_box(lumps.world_bounds().min, lumps.world_bounds().center(), RgbD(0.25));
  const Medium medium({lumps, box});
  ShellMarcher exact(medium, {});
  RandomStream random(random_key(14));
  for (int i = 0; i < 20; ++i) {
    const Ray ray = random_ray(lumps.world_bounds(), random);
    const std::vector<double> shells = shells_to(20, 7);
    const double t_end = i % 2 ? 13.3 : kInfinity;
    MarchCounters counters;
    exact.march(ray, shells, t_end, std::vector<double>(7, 0.5), true, counters);
    const Means m = over_offsets(medium, ray, shells, t_end, 1e-6, 400);
    const int n = exact.shell_count();
    for (int s = 0; s <= n; ++s)
      EXPECT_NEAR(m.depth[static_cast<std::size_t>(s)], exact.tau(s).r, 1e-3) << s;
    EXPECT_LT((m.i0 - exact.grad_integral(0, n)).length(), 0.02);
    EXPECT_LT((m.i1 - exact.grad_moment(0, n)).length(), 0.2);
  }
}

// What is wide takes few steps, and a mean over neighbours is close to theirs.
TEST(ConeMarcher, WideConesTakeFewStepsAndAreCloseToTheMean) {
  const Volume lumps = make_volume(make_lumps(scaling(Vec3d(0.1))), RgbD(0.3));
  const Medium medium({lumps});
  const Vec3d from(-4, 3, 1), to = lumps.world_bounds().center();
  const Frame frame((to - from).normalized());
  constexpr double kWidth = 0.08;
  double exact = 0, coarse = 0;
  MarchCounters cells;
  std::uint64_t steps = 0;
  constexpr int kAcross = 24;
  for (int i = 0; i < kAcross * kAcross; ++i) {
    const double u = 0.7 * ((i % kAcross + 0.5) / kAcross - 0.5);
    const double v = 0.7 * ((i / kAcross + 0.5) / kAcross - 0.5);
    const Ray ray{from, frame.to_world(Vec3d(u, v, 1).normalized())};
    exact += std::exp(-optical_depth(medium, ray, {}, {}, cells).r);
    const Means m = over_offsets(medium, ray, shells_to(14, 8), kInfinity, kWidth, 4);
    coarse += m.transmittance;
    steps += m.segments;
  }
  EXPECT_NEAR(coarse, exact, 0.005 * exact);
  EXPECT_LT(5 * steps, cells.segments);
}

// Thick media are looked at voxel by voxel however wide a cone is, until nothing comes through.
TEST(ConeMarcher, ThickMediaAreLookedAtFinely) {
  const Volume lumps = make_volume(make_lumps(scaling(Vec3d(0.1))), RgbD(12.0));
  const Medium medium({lumps});
  const Ray ray{{-2, 3, 1}, Vec3d(1, 0.1, 0.02).normalized()};
  ConeMarcher marcher(medium);
  const std::vector<double> shells = shells_to(10, 8), jitter(8, 0.5);
  marcher.begin(ray.origin, shells, 1);
  double scattered = 0;
  MarchCounters counters;
  constexpr int kOffsets = 64;
  // Where light comes from, as a share by shells.
  std::vector<double> share(8, 0);
  for (int k = 0; k < kOffsets; ++k) {
    marcher.march(ray.direction, kInfinity, (k + 0.5) / kOffsets, jitter, false, counters);
    for (int s = 0; s < 8; ++s)
      share[static_cast<std::size_t>(s)] +=
          (std::exp(-marcher.tau(s).r) - std::exp(-marcher.tau(s + 1).r)) / kOffsets;
  }
  ShellMarcher exact(medium, {});
  MarchCounters unused;
  exact.march(ray, shells, kInfinity, jitter, false, unused);
  for (int s = 0; s < 8; ++s) {
    EXPECT_NEAR(share[static_cast<std::size_t>(s)],
                std::exp(-exact.tau(s).r) - std::exp(-exact.tau(s + 1).r), 0.01)
        << s;
    scattered += share[static_cast<std::size_t>(s)];
  }
  EXPECT_NEAR(scattered, 1, 1e-6);
  // 10 m are 100 voxels; the ray meets the ball in the middle and dies soon after.
  EXPECT_LT(counters.segments / kOffsets, 70u);
}

}  // namespace
}  // namespace brume
