#include "vdb_media/light_volume.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "unit/vdb_media/march_cases.h"

namespace brume {
namespace {

using namespace march_cases;

// A smooth puff of 64 nodes across, about 6 world units.
Volume make_puff(double sigma) {
  return make_volume(make_grid(Vec3i(0), Vec3i(64), scaling(Vec3d(0.1)),
                               [](const Vec3d& p) {
                                 const double q = 1 - (p - Vec3d(3.2)).length2() / 9;
                                 return q > 0 ? q * q * (1.2 + std::sin(3 * p.x + 2 * p.y)) : 0;
                               }),
                     RgbD(sigma));
}

double marched(const Volume& v, const Vec3d& p, const Vec3d& light) {
  MarchCounters counters;
  return density_integral(v, {p, (light - p).normalized()}, {0, (light - p).length()}, {},
                          counters);
}

TEST(LightVolume, PointLightAgreesWithMarchingToItsStatedError) {
  const Volume v = make_puff(0.7);
  for (const Vec3d& light : {Vec3d(9, 8, 3), Vec3d(3.2, -1, 3.2)}) {
    const LightVolume table(v, PointOrigin{light}, {});
    EXPECT_LE(table.rms_error(), 0.005);
    EXPECT_GE(table.max_error(), table.rms_error());
    RandomStream random(random_key(31));
    const Box3d box = v.world_bounds();
    double squares = 0;
    constexpr int kPoints = 4000;
    for (int i = 0; i < kPoints; ++i) {
      const Vec3d p = box.min + (box.max - box.min) *
                                    Vec3d(random.uniform(), random.uniform(), random.uniform());
      ASSERT_TRUE(table.covers(p));
      const double error =
          std::exp(-0.7 * table.density_integral(p)) - std::exp(-0.7 * marched(v, p, light));
      squares += error * error;
    }
    const double rms = std::sqrt(squares / kPoints);
    EXPECT_LT(rms, 1.3 * table.rms_error() + 1e-6);
    EXPECT_GT(rms, 0.7 * table.rms_error() - 1e-6);
  }
}

TEST(LightVolume, DirectionalLightThroughARamp) {
  // Density x in a cube of 8: light going down has crossed x (8 - z) at (x, y, z).
  const Volume v = make_volume(
      make_grid(Vec3i(0), Vec3i(17), scaling(Vec3d(0.5)), [](const Vec3d& p) { return p.x; }),
      RgbD(0.02));
  const LightVolume table(v, DirectionOrigin{Vec3d(0, 0, -1)}, {1e-4, 1, 1 << 30});
  for (const Vec3d& p : {Vec3d(2, 3, 1), Vec3d(6.5, 4.25, 7), Vec3d(4, 4, 4)}) {
    // Half a cell above the top node the field falls to zero.
    const double expected = p.x * (8 - p.z) + p.x * 0.25;
    EXPECT_NEAR(table.density_integral(p), expected, 0.02 * expected);
  }
}

TEST(LightVolume, FinerTargetsCostMoreAndErrLess) {
  const Volume v = make_puff(3);
  const PointOrigin light{Vec3d(9, 8, 3)};
  const LightVolume coarse(v, light, {0.5, 1, 1 << 30}), fine(v, light, {1e-9, 1, 1 << 30});
  EXPECT_LT(coarse.memory_bytes() * 20, fine.memory_bytes());
  EXPECT_LT(fine.rms_error() * 3, coarse.rms_error());
  const LightVolume bounded(v, light, {1e-9, 1, coarse.memory_bytes()});
  EXPECT_EQ(bounded.memory_bytes(), coarse.memory_bytes());
}

TEST(LightVolume, IsTheSameForAnyNumberOfThreads) {
  const Volume v = make_puff(1);
  const PointOrigin light{Vec3d(0, 8, 3)};
  const LightVolume one(v, light, {0.005, 1, 1 << 30});
  for (const int threads : {2, 3, 7}) {
    const LightVolume many(v, light, {0.005, threads, 1 << 30});
    EXPECT_EQ(many.rms_error(), one.rms_error());
    RandomStream random(random_key(32));
    for (int i = 0; i < 500; ++i) {
      const Vec3d p = Vec3d(random.uniform(), random.uniform(), random.uniform()) * 6.4;
      EXPECT_EQ(many.density_integral(p), one.density_integral(p));
    }
  }
}

TEST(LightVolume, HomogeneousBoxesAndNothing) {
  const Volume box = make_box(Vec3d(0), Vec3d(2), RgbD(0.5));
  const LightVolume table(box, DirectionOrigin{Vec3d(0, 0, 1)}, {});
  EXPECT_NEAR(table.density_integral(Vec3d(0.7, 1.1, 1.5)), 1.5, 1e-6);
  EXPECT_FALSE(table.covers(Vec3d(3)));
  EXPECT_THROW(LightVolume(Volume(), PointOrigin{}, {}), Error);
  const Volume empty =
      make_volume(BrickGrid::from_dense(Vec3i(0), Vec3i(2), std::vector<float>(8, 0.0f), {}));
  const LightVolume nothing(empty, PointOrigin{}, {});
  EXPECT_EQ(nothing.memory_bytes(), 0u);
  EXPECT_FALSE(nothing.covers(Vec3d(0)));
  EXPECT_EQ(nothing.density_integral(Vec3d(0)), 0);
}

}  // namespace
}  // namespace brume
