#include "data_gen/noise.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "data_gen/smoke_plume.h"
#include "data_gen/smoky_cornell.h"

namespace brume {
namespace {

Vec3d random_point(RandomStream& random, double reach) {
  return {(random.uniform() * 2 - 1) * reach, (random.uniform() * 2 - 1) * reach,
          (random.uniform() * 2 - 1) * reach};
}

TEST(GradientNoise, GradientIsTheSlopeOfItsValue) {
  const GradientNoise noise(5);
  RandomStream random(1);
  constexpr double kStep = 1e-5;
  for (int i = 0; i < 200; ++i) {
    const Vec3d p = random_point(random, 20);
    const Vec3d gradient = noise.at(p).gradient;
    for (int axis = 0; axis < 3; ++axis) {
      Vec3d d(0.0);
      d[axis] = kStep;
      EXPECT_NEAR(gradient[axis], (noise.value(p + d) - noise.value(p - d)) / (2 * kStep), 1e-8)
          << p;
    }
  }
}

TEST(GradientNoise, IsZeroOnTheLatticeAndContinuousThroughIt) {
  const GradientNoise noise(5);
  EXPECT_EQ(noise.value({3, -4, 0}), 0);
  for (int i = -3; i <= 3; ++i) {
    const Vec3d p(i, 0.3, -0.7);
    EXPECT_NEAR(noise.value(p - Vec3d(1e-9, 0, 0)), noise.value(p + Vec3d(1e-9, 0, 0)), 1e-8);
  }
}

TEST(GradientNoise, HasNoMeanAndDiffersBetweenSeeds) {
  const GradientNoise a(5), b(6);
  RandomStream random(2);
  constexpr int kPoints = 20'000;
  double sum = 0, sum_squares = 0, product = 0;
  for (int i = 0; i < kPoints; ++i) {
    const Vec3d p = random_point(random, 200);
    const double va = a.value(p);
    sum += va;
    sum_squares += va * va;
    product += va * b.value(p);
    EXPECT_LE(std::abs(va), 1.1);
  }
  const double variance = sum_squares / kPoints;
  EXPECT_GT(variance, 0.02);
  // Four standard errors.
  EXPECT_LT(std::abs(sum / kPoints), 4 * std::sqrt(variance / kPoints));
  EXPECT_LT(std::abs(product / kPoints), 4 * variance / std::sqrt(kPoints));
}

TEST(CurlNoise, HasNoDivergence) {
  const CurlNoise flow(9);
  RandomStream random(3);
  constexpr double kStep = 1e-4;
  double speed = 0;
  for (int i = 0; i < 200; ++i) {
    const Vec3d p = random_point(random, 10);
    double divergence = 0;
    for (int axis = 0; axis < 3; ++axis) {
      Vec3d d(0.0);
      d[axis] = kStep;
      divergence += (flow.velocity(p + d)[axis] - flow.velocity(p - d)[axis]) / (2 * kStep);
    }
    // The second derivatives that cancel are continuous, their slopes are not: first order in the
    // step.
    EXPECT_NEAR(divergence, 0, 1e-2) << p;
    speed += flow.velocity(p).length() / 200;
  }
  EXPECT_GT(speed, 0.3);
}

TEST(SmokePlume, RisesFromItsSourceAndFadesAtTheWalls) {
  const SmokePlume plume = smoky_cornell_plume(5);
  RandomStream random(4);
  double inside = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vec3d p = random_point(random, 1) + Vec3d(0, 1, 0);
    const double value = plume_density(plume, p);
    EXPECT_GE(value, 0);
    EXPECT_LE(value, 1.5);
    inside += value;
    if (p.y < plume.source.y) {
      EXPECT_EQ(value, 0) << p;
    }
    EXPECT_EQ(plume_density(plume, {-1, p.y, p.z}), 0);
    EXPECT_EQ(plume_density(plume, {p.x, 2, p.z}), 0);
  }
  EXPECT_GT(inside, 0);
}

TEST(Dust, IsThickerTowardsTheGroundAndEvenWithoutContrast) {
  Dust dust;
  dust.contrast = 0;
  EXPECT_DOUBLE_EQ(dust_density(dust, {0.3, 0, 0.1}), 1);
  EXPECT_NEAR(dust_density(dust, {0.3, 1, 0.1}), std::exp(-1.0), 1e-15);
  dust.contrast = 1;
  RandomStream random(5);
  double mean = 0;
  for (int i = 0; i < 4000; ++i) {
    Vec3d p = random_point(random, 30);
    p.y = 0;
    const double value = dust_density(dust, p);
    EXPECT_GE(value, 0);
    mean += value / 4000;
  }
  EXPECT_NEAR(mean, 1, 0.1);
}

}  // namespace
}  // namespace brume
