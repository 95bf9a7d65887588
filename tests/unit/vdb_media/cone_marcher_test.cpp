#include "vdb_media/cone_marcher.h"

#include <gtest/gtest.h>

#include <cstring>

#include "cone_kernel.h"
#include "support/instruction_sets.h"
#include "unit/vdb_media/march_cases.h"
#include "vdb_media/brick_pyramid.h"
#include "vdb_media/depth_marcher.h"

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

// `count` rays along one line that look at places of their own, evenly.
std::vector<ConeRay> cones(const Ray& ray, double end, int first, int count) {
  std::vector<ConeRay> rays;
  for (int k = first; k < count && int(rays.size()) < ConeMarcher::kRays; ++k) {
    const double choice = k * (std::numbers::phi - 1);
    rays.push_back(
        {ray.direction, end, float((k + 0.5) / count), float(choice - std::floor(choice))});
  }
  return rays;
}

// Means over such rays.
struct Means {
  std::vector<double> integral;  // Of the first volume, by shell.
  Vec3d i0{0.0}, i1{0.0};
  double transmittance = 0;
  std::vector<double>
      reaching;  // What would reach the origin of a source of 1 / sigma_t, by shell.
  double segments = 0;
};
Means mean_of(const Medium& medium, const Ray& ray, const std::vector<double>& shells, double t_end,
              double width, int count) {
  ConeMarcher marcher(medium);
  const std::vector<float> shifts(shells.size() - 1, 0.25f);
  marcher.begin(ray.origin, shells, width, shifts);
  Means m;
  m.integral.assign(shells.size(), 0);
  m.reaching.assign(shells.size(), 0);
  MarchCounters counters;
  for (int k = 0; k < count; k += ConeMarcher::kRays) {
    const std::vector<ConeRay> rays = cones(ray, t_end, k, count);
    marcher.march(rays, true, counters);
    for (int r = 0; r < int(rays.size()); ++r) {
      const MarchedShells marched = marcher.ray(r);
      const int n = marched.shell_count();
      for (int s = 0; s < n; ++s) {
        m.integral[std::size_t(s)] += marched.shell(0, s).integral / count;
        m.reaching[std::size_t(s)] +=
            marched.transmittance(s).r * marched.shell(0, s).integral / count;
      }
      m.transmittance += marched.transmittance().r / count;
      m.i0 += marched.grad_integral(0, n) / count;
      m.i1 += marched.grad_moment(0, n) / count;
    }
  }
  m.segments = double(counters.segments) / count;
  return m;
}

// As fine as voxels, the mean is what marching cell by cell finds.
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
    const Means m = mean_of(medium, ray, shells, t_end, 1e-6, 400);
    const int n = exact.shell_count();
    for (int s = 0; s < n; ++s)
      EXPECT_NEAR(m.integral[std::size_t(s)], exact.shell(0, s).integral, 1e-3) << s;
    EXPECT_NEAR(m.transmittance, std::exp(-exact.tau(n).r), 2e-3);
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
  double steps = 0;
  constexpr int kAcross = 24;
  for (int i = 0; i < kAcross * kAcross; ++i) {
    const double u = 0.7 * ((i % kAcross + 0.5) / kAcross - 0.5);
    const double v = 0.7 * ((i / kAcross + 0.5) / kAcross - 0.5);
    const Ray ray{from, frame.to_world(Vec3d(u, v, 1).normalized())};
    exact += std::exp(-optical_depth(medium, ray, {}, {}, cells).r);
    const Means m = mean_of(medium, ray, shells_to(14, 8), kInfinity, kWidth, 4);
    coarse += m.transmittance;
    steps += m.segments;
  }
  EXPECT_NEAR(coarse, exact, 0.005 * exact);
  EXPECT_LT(5 * steps, double(cells.segments));
}

// Thick media are looked at voxel by voxel however wide a cone is, until nothing comes through.
TEST(ConeMarcher, ThickMediaAreLookedAtFinely) {
  const Volume lumps = make_volume(make_lumps(scaling(Vec3d(0.1))), RgbD(12.0));
  const Medium medium({lumps});
  const Ray ray{{-2, 3, 1}, Vec3d(1, 0.1, 0.02).normalized()};
  const std::vector<double> shells = shells_to(10, 8), jitter(8, 0.5);
  const Means m = mean_of(medium, ray, shells, kInfinity, 1, 64);
  ShellMarcher exact(medium, {});
  MarchCounters unused;
  exact.march(ray, shells, kInfinity, jitter, false, unused);
  double all = 0;
  for (int s = 0; s < 8; ++s) {
    const double share = 12 * m.reaching[std::size_t(s)];
    EXPECT_NEAR(share, std::exp(-exact.tau(s).r) - std::exp(-exact.tau(s + 1).r), 0.01) << s;
    all += share;
  }
  EXPECT_NEAR(all, 1, 1e-5);
}

// A shell's sample lies as densities and what dims them say.
TEST(ConeMarcher, SamplesOfAnEvenMediumFollowTransmittance) {
  const Medium medium({make_box(Vec3d(-9), Vec3d(9), RgbD(0.8))});
  ConeMarcher marcher(medium);
  const std::vector<double> shells{1, 4};
  const std::vector<float> shifts{0.3f};
  marcher.begin(Vec3d(0), shells, 0.05, shifts);
  double mean = 0;
  MarchCounters counters;
  constexpr int kCount = 4096;
  for (int k = 0; k < kCount; k += ConeMarcher::kRays) {
    marcher.march(cones({}, kInfinity, k, kCount), false, counters);
    for (int r = 0; r < ConeMarcher::kRays; ++r)
      mean += marcher.ray(r).shell(0, 0).t_sample / kCount;
  }
  // Of exp(-0.8 t) over [1, 4].
  const double e = std::exp(-0.8 * 3);
  EXPECT_NEAR(mean, 1 + 1 / 0.8 - 3 * e / (1 - e), 2e-3);
}

// Even steps of a voxel, in their middles, against cells; in packets that are not full too.
TEST(DepthMarcher, StepsAreCloseToCells) {
  const Volume lumps = make_volume(make_lumps(crooked_map()));
  const BrickPyramid pyramid(lumps.density);
  const double voxel = lumps.density->voxel_size();
  const DepthMarcher marcher(lumps, pyramid, voxel, voxel);
  RandomStream random(random_key(16));
  double squares = 0, all = 0;
  for (int n = 1; n <= DepthMarcher::kRays; ++n) {
    std::vector<Ray> rays;
    std::vector<double> ends;
    for (int i = 0; i < n; ++i) {
      rays.push_back(random_ray(lumps.world_bounds(), random));
      ends.push_back(i % 2 ? kInfinity : 6);
    }
    std::vector<float> found(rays.size());
    marcher.march(rays, ends, found);
    MarchCounters unused;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const double exact = density_integral(lumps, rays[i], {0, ends[i]}, {}, unused);
      squares += (found[i] - exact) * (found[i] - exact);
      all += exact * exact;
    }
  }
  EXPECT_LT(std::sqrt(squares / all), 0.02);
}

// A grid whose nodes 32 bits cannot number is looked at on its next level.
TEST(ConeKernel, LargeGridsAreNotCounted) {
  constexpr std::int64_t kBricks = 2'945'793;  // As many as have fewer than 2^31 nodes.
  EXPECT_LE(kBricks * BrickGrid::kBrickFloats, std::int64_t{1} << 31);
  EXPECT_TRUE(is_countable(kBricks, 10 * kBricks));
  EXPECT_FALSE(is_countable(kBricks + 1, 10 * kBricks));
  EXPECT_FALSE(is_countable(1000, std::int64_t{1} << 31));
  const BrickPyramid pyramid(make_lumps(crooked_map()));
  EXPECT_EQ(cone_level_for(pyramid, 0), 0);
  EXPECT_EQ(cone_level_for(pyramid, 100), pyramid.level_count() - 1);
}

// Bits are the same whatever the vectors, so records are the same on all machines.
TEST(ConeMarcher, AllInstructionSetsGiveTheSameBits) {
  const Volume lumps = make_volume(make_lumps(crooked_map()), RgbD(0.4, 0.5, 0.6)),
               box = make_box(lumps.world_bounds().min, lumps.world_bounds().center(), RgbD(0.25));
  const Medium medium({lumps, box});
  const auto bits = [&] {
    std::vector<float> all;
    ConeMarcher marcher(medium);
    RandomStream random(random_key(15));
    const std::vector<double> shells = shells_to(20, 9);
    const std::vector<float> shifts{0.1f, 0.9f, 0.3f, 0.7f, 0.5f, 0.2f, 0.8f, 0.4f, 0.6f};
    MarchCounters counters;
    for (int i = 0; i < 40; ++i) {
      const Ray ray = random_ray(lumps.world_bounds(), random);
      marcher.begin(ray.origin, shells, i % 2 ? 0.06 : 0.5, shifts);
      marcher.march(cones(ray, i % 3 ? kInfinity : 9.1, 0, 16), true, counters);
      for (int r = 0; r < 16; ++r) {
        const MarchedShells m = marcher.ray(r);
        for (int s = 0; s < m.shell_count(); ++s) {
          for (int v = 0; v < 2; ++v) {
            all.push_back(float(m.shell(v, s).integral));
            all.push_back(float(m.shell(v, s).t_sample));
          }
          for (int c = 0; c < 3; ++c) all.push_back(float(m.transmittance(s)[c]));
          for (int a = 0; a < 3; ++a) all.push_back(float(m.grad_moment(0, s)[a]));
        }
        for (int c = 0; c < 3; ++c) all.push_back(float(m.transmittance()[c]));
      }
    }
    return all;
  };
  const std::vector<float> expected = bits();
  for_each_instruction_set([&](const char* name) {
    const std::vector<float> found = bits();
    ASSERT_EQ(found.size(), expected.size());
    EXPECT_EQ(std::memcmp(found.data(), expected.data(), found.size() * sizeof(float)), 0) << name;
  });
}

}  // namespace
}  // namespace brume
