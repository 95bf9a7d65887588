#include "vdb_media/ray_marcher.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "support/instruction_sets.h"
#include "unit/vdb_media/march_cases.h"

namespace brume {
namespace {

using namespace march_cases;

double integral(const Volume& v, const Ray& ray, Interval t = {}, MarchOptions options = {}) {
  MarchCounters counters;
  return density_integral(v, ray, t, options, counters);
}

Ray ray_between(const Vec3d& a, const Vec3d& b) { return {a, (b - a).normalized()}; }

// The field 1 on [0, 8 n)^3, as bricks of ones or as tiles, with hard faces.
std::shared_ptr<const BrickGrid> make_block(int n, bool tiles, const Affine3d& map = {},
                                            const Vec3i& first_brick = Vec3i(0)) {
  std::vector<std::int32_t> top(std::size_t(n) * n * n, tiles ? -2 : 0);
  std::vector<float> ones(tiles ? 0 : BrickGrid::kBrickFloats, 1.0f);
  return std::make_shared<BrickGrid>(first_brick, Vec3i(n), top, ones, std::vector<float>{1.0f},
                                     map);
}

TEST(RayMarcher, LengthInsideABoxIsExact) {
  for (const bool tiles : {false, true}) {
    const Volume v = make_volume(make_block(3, tiles));
    const Box3d box(Vec3d(0), Vec3d(24));
    RandomStream random(random_key(1));
    for (int i = 0; i < 2000; ++i) {
      const Ray ray = random_ray(box, random);
      const Interval inside = clip(ray, box, {});
      const double length = inside.end - inside.begin;
      EXPECT_NEAR(integral(v, ray), length, 1e-12 * std::max(1.0, length));
    }
  }
}

// Both signs of zero, faces, edges and corners; the far faces are outside, the near ones inside.
TEST(RayMarcher, HalfOpenOnFacesEdgesAndCorners) {
  const Volume v = make_volume(make_block(2, false));
  for (const double zero : {0.0, -0.0})
    for (const double sign : {1.0, -1.0})
      for (const double y : {0.0, 3.0, 3.5, 8.0, 16.0})
        for (const double z : {0.0, 5.25, 8.0, 16.0}) {
          const double expected = y < 16 && z < 16 ? 16 : 0;
          const double from = sign > 0 ? -4 : 20;
          const Vec3d d(sign, zero, zero);
          EXPECT_NEAR(integral(v, {Vec3d(from, y, z), d}), expected, 1e-12) << y << " " << z;
          EXPECT_NEAR(integral(v, {Vec3d(y, from, z), Vec3d(zero, sign, zero)}), expected, 1e-12);
          EXPECT_NEAR(integral(v, {Vec3d(z, y, from), Vec3d(zero, zero, sign)}), expected, 1e-12);
        }
  const double diagonal = 16 * std::sqrt(3.0);
  EXPECT_NEAR(integral(v, ray_between(Vec3d(-1), Vec3d(20))), diagonal, 1e-12 * diagonal);
  EXPECT_NEAR(integral(v, ray_between(Vec3d(20), Vec3d(-1))), diagonal, 1e-12 * diagonal);
  EXPECT_NEAR(integral(v, ray_between(Vec3d(17, -1, -1), Vec3d(-1, 17, 17))), diagonal,
              1e-12 * diagonal);
  const double edge = 16 * std::sqrt(2.0);
  EXPECT_NEAR(integral(v, ray_between(Vec3d(-1, -1, 0), Vec3d(17, 17, 0))), edge, 1e-12 * edge);
  EXPECT_NEAR(integral(v, ray_between(Vec3d(16, 0, 8), Vec3d(0, 16, 8))), edge, 1e-12 * edge);
}

TEST(RayMarcher, StartsInsideOnFacesAndOnTheUpperBound) {
  const Volume v = make_volume(make_block(2, false));
  EXPECT_NEAR(integral(v, {Vec3d(16, 4.5, 4.5), Vec3d(-1, 0, 0)}), 16, 1e-12);
  EXPECT_NEAR(integral(v, {Vec3d(16, 4.5, 4.5), Vec3d(1, 0, 0)}), 0, 0);
  EXPECT_NEAR(integral(v, {Vec3d(0, 4.5, 4.5), Vec3d(1, 0, 0)}), 16, 1e-12);
  EXPECT_NEAR(integral(v, {Vec3d(0, 4.5, 4.5), Vec3d(-1, 0, 0)}), 0, 0);
  EXPECT_NEAR(integral(v, {Vec3d(8, 8, 8), Vec3d(1, 0, 0)}), 8, 1e-12);
  EXPECT_NEAR(integral(v, {Vec3d(8, 8, 8), Vec3d(0, -1, 0)}), 8, 1e-12);
  EXPECT_NEAR(integral(v, {Vec3d(5, 8, 8), Vec3d(-1, 0, 0)}), 5, 1e-12);
  EXPECT_NEAR(integral(v, ray_between(Vec3d(8), Vec3d(0))), 8 * std::sqrt(3.0), 1e-11);
  EXPECT_NEAR(integral(v, {Vec3d(3.3, 3, 3), Vec3d(1, 0, 0)}, {1, 4}), 3, 1e-12);
}

TEST(RayMarcher, TouchingHalvesGiveTheWhole) {
  const Volume low = make_volume(make_block(1, false)), both = make_volume(make_block(2, false));
  const Volume homogeneous_low = make_box(Vec3d(0), Vec3d(8, 16, 16)),
               homogeneous_high = make_box(Vec3d(8, 0, 0), Vec3d(16)),
               homogeneous_both = make_box(Vec3d(0), Vec3d(16));
  const auto half = [](int first) {
    return make_volume(std::make_shared<BrickGrid>(
        Vec3i(first, 0, 0), Vec3i(1, 2, 2), std::vector<std::int32_t>(4, 0),
        std::vector<float>(BrickGrid::kBrickFloats, 1.0f), std::vector<float>(), Affine3d()));
  };
  const Volume grid_low = half(0), grid_high = half(1);
  std::vector<Ray> rays{{Vec3d(8, -1, 4), Vec3d(0, 1, 0)},
                        {Vec3d(8, -1, 8), Vec3d(-0.0, 1, 0)},
                        {Vec3d(8, 0, 20), Vec3d(0, 0, -1)},
                        ray_between(Vec3d(0), Vec3d(16))};
  RandomStream random(random_key(2));
  for (int i = 0; i < 300; ++i) rays.push_back(random_ray(Box3d(Vec3d(0), Vec3d(16)), random));
  for (const Ray& ray : rays) {
    EXPECT_NEAR(integral(homogeneous_low, ray) + integral(homogeneous_high, ray),
                integral(homogeneous_both, ray), 1e-12);
    EXPECT_NEAR(integral(grid_low, ray) + integral(grid_high, ray), integral(both, ray), 1e-11);
    EXPECT_NEAR(integral(both, ray), integral(homogeneous_both, ray), 1e-11);
  }
}

// gradients.md 7.8.
TEST(RayMarcher, LinearRampIsExact) {
  const Volume v =
      make_volume(make_grid(Vec3i(0), Vec3i(13), {}, [](const Vec3d& p) { return p.x; }));
  MarchCounters counters;
  EXPECT_NEAR(integral(v, ray_between(Vec3d(0, 1, 1), Vec3d(4, 1, 1)), {0, 4}), 8, 8e-12);
  EXPECT_NEAR(integral(v, ray_between(Vec3d(0), Vec3d(4)), {0, 4 * std::sqrt(3.0)}),
              8 * std::sqrt(3.0), 14e-12);
  counters = {};
  const double six = density_integral(v, {Vec3d(2, 1, 1), Vec3d(1, 0, 0)}, {0, 2}, {}, counters);
  EXPECT_NEAR(six, 6, 6e-12);
  EXPECT_EQ(counters.segments, 2u);  // One crossing, at t = 1.
  EXPECT_EQ(counters.rays, 1u);
}

TEST(RayMarcher, SingleVoxelIsItsHat) {
  const double h = 0.25;
  const Volume v = make_volume(
      BrickGrid::from_dense(Vec3i(7, 8, -1), Vec3i(1), {3.0f}, scaling(Vec3d(h), Vec3d(1, 2, 3))));
  const Vec3d c = Vec3d(7, 8, -1) * h + Vec3d(1, 2, 3);
  EXPECT_NEAR(integral(v, {c - Vec3d(9, 0, 0), Vec3d(1, 0, 0)}), 3 * h, 1e-12);
  EXPECT_NEAR(integral(v, {c - Vec3d(0, 9, 0.25 * h), Vec3d(0, 1, 0)}), 3 * 0.75 * h, 1e-12);
  EXPECT_NEAR(integral(v, ray_between(c - Vec3d(5), c + Vec3d(5))), 3 * h * std::sqrt(3.0) / 2,
              1e-6);
  EXPECT_EQ(integral(v, {c - Vec3d(9, h, 0), Vec3d(1, 0, 0)}), 0);
}

TEST(RayMarcher, ExponentialAtmosphere) {
  const double h = 0.05;
  const Volume v = make_volume(make_grid(Vec3i(-20, 0, -20), Vec3i(41, 81, 41), scaling(Vec3d(h)),
                                         [](const Vec3d& p) { return std::exp(-p.y); }));
  // The interpolant of exp exceeds it by h^2/12 on average.
  for (const double slope : {0.0, 0.1, 0.7}) {
    const Vec3d d = Vec3d(slope, 1, -slope / 2).normalized();
    const double length = 1.1 / d.y;
    const double exact = (1 - std::exp(-1.1)) / d.y * (1 + h * h / 12);
    EXPECT_NEAR(integral(v, {Vec3d(0.013, 0, 0.021), d}, {0, length}), exact, 2e-6 * exact);
  }
}

TEST(RayMarcher, AgreesWithTheReference) {
  for (const Affine3d& map : {scaling(Vec3d(0.1)), crooked_map()}) {
    const Volume v = make_volume(make_lumps(map));
    RandomStream random(random_key(3));
    for (int i = 0; i < 400; ++i) {
      const Ray ray = random_ray(v.world_bounds(), random);
      const double end = 20 * random.uniform();
      const double expected = reference_integral(v, ray, 0, end);
      EXPECT_NEAR(integral(v, ray, {0, end}), expected, 1e-6 * expected + 1e-9);
    }
  }
}

TEST(RayMarcher, AllInstructionSetsGiveTheSameBits) {
  const Volume v = make_volume(make_lumps(crooked_map()));
  const Volume w = make_volume(make_lumps(scaling(Vec3d(0.1))));
  const auto integrals = [&](MarchCounters& counters) {
    std::vector<double> all;
    RandomStream random(random_key(4));
    for (int i = 0; i < 5000; ++i) {
      for (const Volume* volume : {&v, &w}) {
        Ray ray = random_ray(volume->world_bounds(), random);
        if (i % 5 == 1) {  // Along an axis, often on a plane of nodes.
          ray.direction = Vec3d(i % 3 == 0, i % 3 == 1, i % 3 == 2) * (i % 2 ? 1.0 : -1.0);
          for (int a = 0; a < 3; ++a) ray.origin[a] = std::round(ray.origin[a] * 10) / 10;
        }
        for (const double step : {0.0, 3.0}) {
          const Interval t{random.uniform() * 5, 5 + random.uniform() * 9};
          all.push_back(density_integral(*volume, ray, t, {step}, counters));
        }
      }
    }
    return all;
  };
  MarchCounters here;
  const std::vector<double> expected = integrals(here);
  for_each_instruction_set([&](const char* name) {
    MarchCounters counters;
    EXPECT_EQ(integrals(counters), expected) << name;
    EXPECT_EQ(counters.segments, here.segments) << name;
  });
}

TEST(RayMarcher, PartsOfAnIntervalAddUp) {
  const Volume lumps = make_volume(make_lumps(crooked_map()));
  const Volume block = make_volume(make_block(3, false));
  RandomStream random(random_key(5));
  for (int i = 0; i < 300; ++i) {
    for (const Volume* v : {&lumps, &block}) {
      const Ray ray = random_ray(v->world_bounds(), random);
      const double whole = integral(*v, ray);
      double parts = 0, t = 0;
      for (int k = 0; k < 20; ++k) {
        const double next = t + random.uniform() * (v == &block ? 6 : 1);
        parts += integral(*v, ray, {t, next});
        t = next;
      }
      parts += integral(*v, ray, {t, kInfinity});
      EXPECT_NEAR(parts, whole, (v == &block ? 1e-12 : 1e-6) * whole + 1e-12);
    }
  }
}

TEST(RayMarcher, TilesAreWhatTheyStandFor) {
  const Affine3d map = crooked_map();
  const Volume bricks = make_volume(make_block(2, false, map)),
               tiles = make_volume(make_block(2, true, map));
  RandomStream random(random_key(6));
  for (int i = 0; i < 500; ++i) {
    const Ray ray = random_ray(bricks.world_bounds(), random);
    const double expected = integral(bricks, ray);
    EXPECT_NEAR(integral(tiles, ray), expected, 1e-12 * (1 + expected));
  }
}

// A field that is linear in world space is the same whatever lattice samples it.
TEST(RayMarcher, AnyAffineMapGivesTheSameIntegral) {
  const auto field = [](const Vec3d& p) { return 3 + 0.2 * p.x - 0.3 * p.y + 0.1 * p.z; };
  Affine3d rotated;
  rotated.m = {{{0.06, -0.08, 0, 0}, {0.08, 0.06, 0, 0}, {0, 0, 0.1, 0}}};
  Affine3d sheared = scaling(Vec3d(0.1));
  sheared.m[0][1] = 0.04;
  sheared.m[2][0] = -0.03;
  for (const Affine3d& map : {scaling(Vec3d(0.1)), scaling(Vec3d(-0.1, 0.1, 0.1)),
                              scaling(Vec3d(0.08, 0.11, 0.2)), rotated, sheared}) {
    const Volume v = make_volume(make_grid(Vec3i(-30), Vec3i(61), map, field));
    RandomStream random(random_key(7));
    for (int i = 0; i < 100; ++i) {
      const auto point = [&] { return sample_sphere(random.uniform2()) * random.uniform(); };
      const Vec3d a = point(), b = point();
      const double length = (b - a).length();
      EXPECT_NEAR(integral(v, ray_between(a, b), {0, length}), field((a + b) / 2) * length,
                  1e-6 * length * 3);
    }
  }
}

TEST(RayMarcher, ScalingByPowersOfTwoScalesTheBits) {
  for (const int power : {-20, -7, 3, 20}) {
    const double k = std::exp2(power);
    const Volume one = make_volume(make_lumps(scaling(Vec3d(0.125), Vec3d(1, 2, 3)))),
                 scaled = make_volume(make_lumps(scaling(Vec3d(0.125 * k), Vec3d(1, 2, 3) * k)));
    RandomStream random(random_key(8));
    for (int i = 0; i < 100; ++i) {
      const Ray ray = random_ray(one.world_bounds(), random);
      EXPECT_EQ(integral(scaled, {ray.origin * k, ray.direction}), k * integral(one, ray));
    }
  }
}

TEST(RayMarcher, FarEyesAndFarGrids) {
  const Volume v = make_volume(make_lumps(scaling(Vec3d(0.1))));
  const Vec3d c = v.world_bounds().center(), d = Vec3d(1, 2, -2).normalized();
  const double near = integral(v, {c - d * 10, d});
  EXPECT_NEAR(integral(v, {c - d * 1e12, d}), near, 2e-3 * near);
  EXPECT_NEAR(integral(v, {c - d * 1e7, d}), near, 1e-6 * near);
  const Vec3d far(1 << 17, -(1 << 17), 1 << 16);
  const Volume moved = make_volume(make_lumps(scaling(Vec3d(0.1), far)));
  EXPECT_NEAR(integral(moved, {c - d * 10 + far, d}), near, 1e-6 * near);
}

// Moving the start by a millionth of a voxel, across the boundary as well, changes nothing much.
TEST(RayMarcher, IsContinuousInTheOrigin) {
  const Volume v = make_volume(make_lumps(scaling(Vec3d(0.1))));
  const Box3d box = v.world_bounds();
  RandomStream random(random_key(9));
  for (int i = 0; i < 200; ++i) {
    Ray ray = random_ray(box, random);
    if (i % 2) ray.origin = ray.at(clip(ray, box, {}).begin);
    const double before = integral(v, ray);
    for (const double e : {1e-7, -1e-7}) {
      const Ray moved{ray.origin + Vec3d(e, e, -e), ray.direction};
      EXPECT_NEAR(integral(v, moved), before, 1e-5 * (1 + before));
    }
  }
}

TEST(RayMarcher, EmptyAndUnusualInput) {
  const Volume empty =
      make_volume(BrickGrid::from_dense(Vec3i(0), Vec3i(4), std::vector<float>(64, 0.0f), {}));
  MarchCounters counters;
  EXPECT_EQ(density_integral(empty, {}, {}, {}, counters), 0);
  EXPECT_EQ(counters.rays, 0u);
  const Volume v = make_volume(make_block(2, false));
  EXPECT_EQ(integral(v, {Vec3d(1), Vec3d(1, 0, 0)}, {3, 3}), 0);
  EXPECT_EQ(integral(v, {Vec3d(1), Vec3d(1, 0, 0)}, {5, 3}), 0);
  EXPECT_EQ(integral(v, {Vec3d(NAN, 1, 1), Vec3d(1, 0, 0)}), 0);
  EXPECT_EQ(integral(v, {Vec3d(1), Vec3d(NAN, 0, 0)}), 0);
  EXPECT_EQ(integral(v, {Vec3d(1), Vec3d(1, 0, 0)}, {0, NAN}), 0);
  EXPECT_EQ(integral(v, {Vec3d(1), Vec3d(0, 0, 0)}), 0);
  // An axis that barely moves, on a plane and off it.
  for (const double tiny : {1e-17, -1e-17, 1e-200, -1e-310})
    for (const double y : {4.0, 4.5})
      EXPECT_NEAR(integral(v, {Vec3d(-1, y, 4), Vec3d(1, tiny, tiny)}), 16, 1e-12);
  const Volume inside_out = make_box(Vec3d(1), Vec3d(-1));
  EXPECT_EQ(integral(inside_out, {}), 0);
}

TEST(RayMarcher, EndlessHomogeneousMediaKeepTransmittanceInRange) {
  Volume v;
  v.sigma_a = RgbD(0, 1e-30, 1e30);
  MarchCounters counters;
  const Medium medium({v});
  const RgbD endless = optical_depth(medium, {}, {}, {}, counters);
  EXPECT_EQ(endless.r, 0);
  EXPECT_EQ(exp_neg(endless).g, 0);
  const RgbD finite = optical_depth(medium, {}, {0, 2}, {}, counters);
  EXPECT_EQ(finite.r, 0);
  EXPECT_DOUBLE_EQ(finite.g, 2e-30);
  EXPECT_DOUBLE_EQ(finite.b, 2e30);
  EXPECT_EQ(exp_neg(finite).b, 0);
  EXPECT_TRUE(is_black(optical_depth(Medium(), {}, {}, {}, counters)));
}

TEST(RayMarcher, OverlappingVolumesAddUp) {
  const Volume a = make_volume(make_lumps(crooked_map()), RgbD(1, 2, 3)),
               b = make_box(a.world_bounds().min, a.world_bounds().center(), RgbD(0.1, 0, 0.5));
  RandomStream random(random_key(10));
  MarchCounters counters;
  const Medium both({a, b}), first({a}), second({b});
  for (int i = 0; i < 100; ++i) {
    const Ray ray = random_ray(a.world_bounds(), random);
    const RgbD sum =
        optical_depth(first, ray, {}, {}, counters) + optical_depth(second, ray, {}, {}, counters);
    EXPECT_EQ(optical_depth(both, ray, {}, {}, counters), sum);
  }
}

TEST(RayMarcher, CoarseStepsAreFewerAndClose) {
  const Volume v =
      make_volume(make_grid(Vec3i(0), Vec3i(64), scaling(Vec3d(0.1)),
                            [](const Vec3d& p) { return std::exp(-(p - Vec3d(3)).length2()); }));
  RandomStream random(random_key(12));
  MarchCounters fine, coarse;
  for (int i = 0; i < 200; ++i) {
    const Ray ray = random_ray(Box3d(Vec3d(1), Vec3d(5)), random);
    const double exact = density_integral(v, ray, {}, {1}, fine);
    EXPECT_NEAR(density_integral(v, ray, {}, {4}, coarse), exact, 2e-3);
  }
  EXPECT_LT(coarse.segments, fine.segments * 2 / 3);
}

// --- Shells ---

std::vector<double> even_shells(double begin, double end, int n) {
  std::vector<double> b;
  for (int i = 0; i <= n; ++i) b.push_back(begin + (end - begin) * i / n);
  return b;
}

TEST(ShellMarcher, ShellsAreThePartsOfTheIntegral) {
  const Volume grid = make_volume(make_lumps(crooked_map()), RgbD(1, 2, 3)),
               box = make_box(grid.world_bounds().min, grid.world_bounds().center(), RgbD(0.25));
  const Medium medium({grid, box});
  ShellMarcher marcher(medium, {});
  RandomStream random(random_key(13));
  MarchCounters counters;
  for (int i = 0; i < 200; ++i) {
    const Ray ray = random_ray(grid.world_bounds(), random);
    // Shells from far wider than a brick to far narrower than a cell.
    const int n = i % 3 == 0 ? 5 : i % 3 == 1 ? 60 : 700;
    const auto edges = even_shells(2, 14, n);
    const double t_end = i % 4 == 0 ? 8.03 : kInfinity;
    const std::vector<double> jitter(n, random.uniform());
    marcher.march(ray, edges, t_end, jitter, i % 2, counters);
    RgbD tau;
    for (int s = 0; s < n; ++s) {
      const double begin = edges[s], end = std::min(edges[s + 1], t_end);
      if (s >= marcher.shell_count()) {
        EXPECT_GE(begin, t_end);
        EXPECT_EQ(marcher.shell(0, s).integral, 0);
        continue;
      }
      EXPECT_LT(begin, t_end);
      EXPECT_NEAR(marcher.tau(s).g, tau.g, 1e-5);
      for (int v = 0; v < 2; ++v) {
        const Volume& volume = medium.volumes()[v];
        const double expected = integral(volume, ray, {begin, end}, {});
        const ShellDensity& shell = marcher.shell(v, s);
        EXPECT_NEAR(shell.integral, expected, 1e-6 * expected + 1e-10);
        EXPECT_GE(shell.t_sample, begin);
        EXPECT_LE(shell.t_sample, end);
        if (shell.integral > 1e-6) {
          EXPECT_GT(volume.density_at(ray.at(shell.t_sample)), 0);
        }
        tau += volume.sigma_t() * expected;
      }
    }
    EXPECT_NEAR(marcher.tau(marcher.shell_count()).g, tau.g, 1e-5);
  }
}

TEST(ShellMarcher, AllInstructionSetsGiveTheSameBits) {
  const auto bits = [] {
    std::vector<double> all;
    MarchCounters counters;
    for (const Affine3d& map : {crooked_map(), scaling(Vec3d(0.1))}) {
      const Medium medium({make_volume(make_lumps(map), RgbD(1, 2, 3))});
      RandomStream random(random_key(14));
      for (const double step : {0.0, 2.5}) {
        ShellMarcher marcher(medium, {step});
        for (int i = 0; i < 1000; ++i) {
          const Ray ray = random_ray(medium.bounds(), random);
          const int n = 1 + int(random.uniform() * 100);
          std::vector<double> jitter;
          for (int s = 0; s < n; ++s) jitter.push_back(random.uniform());
          marcher.march(ray, even_shells(0, 15, n), 12.3, jitter, true, counters);
          for (int s = 0; s < marcher.shell_count(); ++s) {
            all.push_back(marcher.shell(0, s).integral);
            all.push_back(marcher.shell(0, s).t_sample);
            for (int a = 0; a < 3; ++a) {
              all.push_back(marcher.tau(s + 1)[a]);
              all.push_back(marcher.grad_integral(0, s + 1)[a]);
              all.push_back(marcher.grad_moment(0, s + 1)[a]);
            }
          }
        }
      }
    }
    all.push_back(double(counters.segments));
    return all;
  };
  const std::vector<double> expected = bits();
  EXPECT_GT(expected.size(), 100'000u);
  for_each_instruction_set([&](const char* name) { EXPECT_EQ(bits(), expected) << name; });
}

TEST(ShellMarcher, GradientIntegralsAgreeWithTheReference) {
  for (const Affine3d& map : {scaling(Vec3d(0.1)), crooked_map()}) {
    const Medium medium({make_volume(make_lumps(map))});
    const Volume& v = medium.volumes()[0];
    ShellMarcher marcher(medium, {});
    MarchCounters counters;
    RandomStream random(random_key(15));
    for (int i = 0; i < 100; ++i) {
      const Ray ray = random_ray(medium.bounds(), random);
      const auto edges = even_shells(0.3, 13, 9);
      marcher.march(ray, edges, 11.7, std::vector<double>(9, 0.5), true, counters);
      for (int s = 0; s <= marcher.shell_count(); ++s) {
        const double end = std::min(edges[s], 11.7);
        const auto gradient = [&](double t) { return v.density_gradient_at(ray.at(t)).gradient; };
        const Vec3d i0 = integrate_by_cells<Vec3d>(*v.density, ray, 0.3, end, gradient, Vec3d(0.0));
        const Vec3d i1 = integrate_by_cells<Vec3d>(
            *v.density, ray, 0.3, end, [&](double t) { return gradient(t) * t; }, Vec3d(0.0));
        const Affine3d& to_index = v.density->world_to_index();
        EXPECT_LT((to_index.transposed_vector(marcher.grad_integral(0, s)) - i0).length(), 3e-5);
        EXPECT_LT((to_index.transposed_vector(marcher.grad_moment(0, s)) - i1).length(), 3e-4);
      }
    }
  }
}

// gradients.md 7.8: a field that is x itself, along planes, through corners and from a node.
TEST(DensityIntegral, RampIsExactAlongPlanesAndThroughCorners) {
  const Volume v = make_volume(
      make_grid(Vec3i(0), Vec3i(6), scaling(Vec3d(1.0)), [](const Vec3d& p) { return p.x; }));
  const auto between = [&](const Vec3d& a, const Vec3d& b) {
    MarchCounters counters;
    return density_integral(v, Ray{a, (b - a).normalized()}, {0, (b - a).length()}, {}, counters);
  };
  EXPECT_NEAR(between({0, 1, 1}, {4, 1, 1}), 8, 1e-6);
  EXPECT_NEAR(between({0, 0, 0}, {4, 4, 4}), 13.856406460551, 2e-6);
  EXPECT_NEAR(between({2, 1, 1}, {4, 1, 1}), 6, 1e-6);
  EXPECT_NEAR(between({4, 1, 1}, {2, 1, 1}), 6, 1e-6);
}

// oracle_cases.md, A6: 0.1 and three Gaussians, here on a lattice of step h.
struct OracleA6 {
  double tau;
  Vec3d fixed_end, both_ends;
};

OracleA6 march_a6(double h) {
  struct Gaussian {
    Vec3d c;
    double a, b;
  };
  const Gaussian g3[] = {
      {{0.4, -0.3, 0.9}, 1.2, 0.45}, {{-0.7, 0.5, 0.5}, 0.9, 0.35}, {{0.1, 0.9, 1.4}, 0.8, 0.5}};
  const Vec3d low(-0.9, -0.5, -0.3), high(1.2, 0.55, 1.6);
  Vec3i count;
  for (int a = 0; a < 3; ++a) count[a] = int(std::ceil((high[a] - low[a]) / h)) + 1;
  const Medium medium(
      {make_volume(make_grid(Vec3i(0), count, scaling(Vec3d(h), low), [&](const Vec3d& p) {
        double s = 0.1;
        for (const Gaussian& g : g3) s += g.a * std::exp(-(p - g.c).length2() / (2 * g.b * g.b));
        return s;
      }))});
  const Vec3d x(-0.6, 0.25, 0), y(0.9, -0.2, 1.3);
  const double length = (y - x).length();
  ShellMarcher marcher(medium, {});
  MarchCounters counters;
  const std::vector<double> edges = even_shells(0, length, 7), jitter(7, 0.5);
  marcher.march(ray_between(x, y), edges, kInfinity, jitter, true, counters);
  const Affine3d& to_index = medium.volumes()[0].density->world_to_index();
  const Vec3d i0 = to_index.transposed_vector(marcher.grad_integral(0, 7)),
              i1 = to_index.transposed_vector(marcher.grad_moment(0, 7));
  const double tau = marcher.tau(7).r;
  // gradients.md 2, form B: grad tau = -w tau / t + integral of (1 - u / t) grad sigma.
  return {tau, (y - x) / length * (-tau / length) + i0 - i1 / length, i0};
}

TEST(ShellMarcher, OracleA6) {
  const OracleA6 coarse = march_a6(0.05), fine = march_a6(0.025);
  const double tau = 1.517517640009;
  const Vec3d fixed_end(-0.665718230, 0.118361631, 0.260543793),
      both_ends(-0.563234613, -0.582019707, 0.752793499);
  EXPECT_NEAR(fine.tau, tau, 1e-3);
  EXPECT_LT((fine.fixed_end - fixed_end).length(), 3e-2);
  // The lattice's own error falls with h^2 for tau; taken off it:
  EXPECT_NEAR((4 * fine.tau - coarse.tau) / 3, tau, 1e-5);
  const OracleA6 finest = march_a6(0.0125);
  EXPECT_NEAR((4 * finest.tau - fine.tau) / 3, tau, 2e-6);
  EXPECT_LT((finest.fixed_end - fixed_end).length(), 4e-3);
  EXPECT_LT((finest.both_ends - both_ends).length(), 4e-3);
}

// The mean of t over density * transmittance in a shell, by a fine sum.
double mean_t(const Volume& v, const Ray& ray, double begin, double end) {
  constexpr int kSteps = 4000;
  double depth = 0, weight = 0, sum = 0;
  const double h = (end - begin) / kSteps;
  for (int i = 0; i < kSteps; ++i) {
    const double t = begin + (i + 0.5) * h;
    const double d = v.density_at(ray.at(t)) * h * mean_component(v.sigma_t());
    const double w = d * std::exp(-depth - d / 2);
    depth += d;
    weight += w;
    sum += w * t;
  }
  return sum / weight;
}

TEST(ShellMarcher, SamplesFollowDensityTimesTransmittance) {
  for (const double sigma : {1e-4, 0.05, 1.0, 30.0}) {
    const Volume ramp = make_volume(
                     make_grid(Vec3i(0), Vec3i(12), {}, [](const Vec3d&p) { return 0.1 + p.x; }),
                     RgbD(sigma)),
                 lumps = make_volume(make_lumps(scaling(Vec3d(0.5))), RgbD(sigma)),
                 box = make_box(Vec3d(1), Vec3d(9), RgbD(sigma));
    for (const Volume* v : {&ramp, &lumps, &box}) {
      const Medium medium({*v});
      ShellMarcher marcher(medium, {});
      MarchCounters counters;
      const Vec3d c = v->world_bounds().center();
      const Ray ray = ray_between(c - Vec3d(5, 1, 0.7), c);
      const std::vector<double> edges{0, 3, 5.5, 6};
      constexpr int kStrata = 2000;
      std::vector<double> sums(3, 0.0);
      for (int i = 0; i < kStrata; ++i) {
        const std::vector<double> jitter(3, (i + 0.5) / kStrata);
        marcher.march(ray, edges, kInfinity, jitter, false, counters);
        for (int s = 0; s < 3; ++s) sums[s] += marcher.shell(0, s).t_sample / kStrata;
      }
      for (int s = 0; s < 3; ++s) {
        if (marcher.shell(0, s).integral == 0) continue;
        const double width = edges[s + 1] - edges[s];
        EXPECT_NEAR(sums[s], mean_t(*v, ray, edges[s], edges[s + 1]), 2e-3 * width)
            << "sigma " << sigma << " shell " << s;
      }
    }
  }
}

TEST(ShellMarcher, SamplesAreUniformWhereNothingIs) {
  const Medium medium({make_box(Vec3d(10), Vec3d(11))});
  ShellMarcher marcher(medium, {});
  MarchCounters counters;
  const std::vector<double> edges{1, 2, 4}, jitter{0.25, 0.5};
  marcher.march({}, edges, 3, jitter, true, counters);
  EXPECT_EQ(marcher.shell_count(), 2);
  EXPECT_DOUBLE_EQ(marcher.shell(0, 0).t_sample, 1.25);
  EXPECT_DOUBLE_EQ(marcher.shell(0, 1).t_sample, 2.5);
  EXPECT_EQ(counters.segments, 0u);
  marcher.march({}, edges, 0.5, jitter, true, counters);
  EXPECT_EQ(marcher.shell_count(), 0);
}

TEST(ShellMarcher, HomogeneousIsClosedForm) {
  const Medium medium({make_box(Vec3d(-1, -1, 2), Vec3d(1, 1, 5), RgbD(1, 2, 4))});
  ShellMarcher marcher(medium, {});
  MarchCounters counters;
  const std::vector<double> edges{0, 2.5, 3, 10}, jitter(3, 0.5);
  marcher.march({}, edges, kInfinity, jitter, true, counters);
  EXPECT_DOUBLE_EQ(marcher.shell(0, 0).integral, 0.5);
  EXPECT_DOUBLE_EQ(marcher.shell(0, 1).integral, 0.5);
  EXPECT_DOUBLE_EQ(marcher.shell(0, 2).integral, 2);
  EXPECT_DOUBLE_EQ(marcher.tau(2).b, 4);
  EXPECT_DOUBLE_EQ(marcher.tau(3).g, 6);
  // Half of what is scattered in the first shell, at sigma 7/3, comes before:
  EXPECT_NEAR(marcher.shell(0, 0).t_sample,
              2 - std::log1p(-0.5 * -std::expm1(-7.0 / 6)) / (7.0 / 3), 1e-12);
  EXPECT_EQ(marcher.grad_integral(0, 3), Vec3d(0.0));
  EXPECT_EQ(counters.segments, 3u);
}

// Thin shells take another formula than thick ones.
TEST(ShellMarcher, SamplesOfHomogeneousShellsInvertTheirTransmittance) {
  const std::vector<double> edges{0, 1};
  MarchCounters counters;
  for (double sigma = 1e-9; sigma < 1e3; sigma *= 1.3) {
    const Medium medium({make_box(Vec3d(-1), Vec3d(2), RgbD(sigma))});
    ShellMarcher marcher(medium, {});
    for (const double u : {0.0, 0.01, 0.3, 0.5, 0.9, 0.999}) {
      const std::vector<double> jitter{u};
      marcher.march({}, edges, kInfinity, jitter, false, counters);
      const long double s = sigma;
      const double expected = double(-std::log1p(u * std::expm1(-s)) / s);
      EXPECT_NEAR(marcher.shell(0, 0).t_sample, expected, 3e-8) << sigma << " " << u;
    }
  }
}

TEST(ShellMarcher, CopiesShareNothing) {
  const Medium medium({make_volume(make_lumps(scaling(Vec3d(0.1))))});
  ShellMarcher a(medium, {});
  MarchCounters counters;
  const Vec3d c = medium.bounds().center();
  const auto edges = even_shells(0, 10, 4);
  const std::vector<double> jitter(4, 0.5);
  a.march({c, Vec3d(1, 0, 0)}, edges, kInfinity, jitter, true, counters);
  const RgbD before = a.tau(4);
  ShellMarcher b(a);
  b.march({c, Vec3d(0, 1, 0)}, edges, kInfinity, jitter, true, counters);
  EXPECT_EQ(a.tau(4), before);
  b = a;
  b.march({c, Vec3d(1, 0, 0)}, edges, kInfinity, jitter, true, counters);
  EXPECT_EQ(b.tau(4), before);
}

}  // namespace
}  // namespace brume
