// The slab that media are held to is itself held to published numbers and to closed forms.
#include "support/plane_slab.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "core/error.h"

namespace brume::test {
namespace {

// Midpoint rule over mu in (0, 1).
double integrate(const std::function<double(double)>& f) {
  constexpr int kSteps = 100'000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) sum += f((i + 0.5) / kSteps);
  return sum / kSteps;
}

// [vdH80]'s slab as [WJZ95] quotes it, to five digits; diffuse light is not given.
TEST(PlaneSlab, IsThatOfVanDeHulst) {
  const SlabFluxes normal = PlaneSlab(2, 0.9, 0.75).normal();
  EXPECT_NEAR(normal.reflected, 0.09739, 5e-6);
  EXPECT_NEAR(normal.transmitted, 0.66096, 5e-6);
}

// The checks of the program that goes with [PGW93], to the four digits that it promises.
TEST(PlaneSlab, IsThatOfPrahl) {
  struct Case {
    double optical_depth, albedo, g, ur1, ut1, uru, utu;
  };
  for (const Case& c : {Case{1, 0.8, 0, 0.21085, 0.54140, 0.28015, 0.41624},
                        Case{1, 0.8, 0.8, 0.03041, 0.76388, 0.08416, 0.61111},
                        Case{100, 0.8, 0, 0.28525, 0, 0.34187, 0}}) {
    const PlaneSlab slab(c.optical_depth, c.albedo, c.g);
    EXPECT_NEAR(slab.normal().reflected, c.ur1, 1e-4) << c.g;
    EXPECT_NEAR(slab.normal().transmitted, c.ut1, 1e-4) << c.g;
    EXPECT_NEAR(slab.diffuse().reflected, c.uru, 1e-4) << c.g;
    EXPECT_NEAR(slab.diffuse().transmitted, c.utu, 1e-4) << c.g;
  }
}

// Of an endlessly deep isotropic medium a beam along mu is reflected by 1 - H(mu) sqrt(1 - albedo)
// [Cha60, chapter 5], where 1/H(mu) = sqrt(1 - albedo) + albedo/2 integral of x H(x)/(x + mu) dx.
TEST(PlaneSlab, DeepOnesFollowChandrasekharsH) {
  for (const double albedo : {0.3, 0.8, 0.99}) {
    constexpr int kSteps = 600;
    const double root = std::sqrt(1 - albedo);
    std::vector<double> h(kSteps, 1);
    const auto at = [&](double mu) {
      double sum = 0;
      for (int i = 0; i < kSteps; ++i) {
        const double x = (i + 0.5) / kSteps;
        sum += x * h[i] / (x + mu) / kSteps;
      }
      return 1 / (root + albedo / 2 * sum);
    };
    for (int round = 0; round < 60; ++round) {
      std::vector<double> next;
      for (int i = 0; i < kSteps; ++i) next.push_back(at((i + 0.5) / kSteps));
      // The mean of two rounds settles where each alone swings.
      for (int i = 0; i < kSteps; ++i) h[i] = (h[i] + next[i]) / 2;
    }
    double diffuse = 0;
    for (int i = 0; i < kSteps; ++i) diffuse += 2 * (i + 0.5) / kSteps * (1 - root * h[i]) / kSteps;
    const PlaneSlab slab(300, albedo);
    EXPECT_NEAR(slab.normal().reflected, 1 - root * at(1), 5e-6) << albedo;
    EXPECT_NEAR(slab.diffuse().reflected, diffuse, 5e-6) << albedo;
  }
}

// 4/3 over the depth and two extrapolated lengths of 0.710446 (Milne's problem): what a deep white
// slab lets through of diffuse light.
TEST(PlaneSlab, DeepWhiteOnesLetThroughWhatMilneSays) {
  for (const double depth : {16.0, 100.0})
    EXPECT_NEAR(PlaneSlab(depth, 1).diffuse().transmitted * (depth + 2 * 0.710446), 4.0 / 3, 5e-6)
        << depth;
}

struct Medium {
  double optical_depth, albedo, g;
};
class AnySlab : public testing::TestWithParam<Medium> {};

TEST_P(AnySlab, LosesNothingWhenWhite) {
  const PlaneSlab slab(GetParam().optical_depth, 1, GetParam().g);
  for (const SlabFluxes& f : {slab.normal(), slab.diffuse()})
    EXPECT_NEAR(f.reflected + f.transmitted, 1, 1e-9);
}

TEST_P(AnySlab, IsReciprocal) {
  const auto [depth, albedo, g] = GetParam();
  EXPECT_LT(PlaneSlab(depth, albedo, g).asymmetry(), 1e-7);
}

// Thirds are not among the layers that doubling goes through.
TEST_P(AnySlab, IsTheSameFromParts) {
  const auto [depth, albedo, g] = GetParam();
  const PlaneSlab whole(depth, albedo, g);
  const PlaneSlab third(depth / 3, albedo, g), rest(depth - depth / 3, albedo, g);
  for (const PlaneSlab& parts : {third.on_top_of(rest), rest.on_top_of(third)})
    for (const bool beam : {true, false}) {
      const SlabFluxes a = beam ? parts.normal() : parts.diffuse();
      const SlabFluxes b = beam ? whole.normal() : whole.diffuse();
      EXPECT_NEAR(a.reflected, b.reflected, 1e-7);
      EXPECT_NEAR(a.transmitted, b.transmitted, 1e-7);
      EXPECT_NEAR(a.unscattered, b.unscattered, 1e-12);
    }
}

TEST_P(AnySlab, OfAlbedoZeroOnlyDims) {
  const double depth = GetParam().optical_depth;
  const PlaneSlab slab(depth, 0, GetParam().g);
  EXPECT_EQ(slab.normal().reflected, 0);
  EXPECT_NEAR(slab.normal().transmitted, std::exp(-depth), 1e-12);
  // Twice the exponential integral E_3.
  const double diffuse = integrate([&](double mu) { return 2 * mu * std::exp(-depth / mu); });
  EXPECT_NEAR(slab.diffuse().transmitted, diffuse, 2e-6);
}

// The part of Henyey-Greenstein that turns a beam along the normal back, in closed form.
double backward(double g) {
  if (g == 0) return 0.5;
  return (1 - g * g) / (2 * g) * (1 / std::sqrt(1 + g * g) - 1 / (1 + g));
}

TEST_P(AnySlab, OfLittleDepthSplitsABeamByItsPhaseFunction) {
  const auto [depth, albedo, g] = GetParam();
  constexpr double kDepth = 1e-7;
  const SlabFluxes f = PlaneSlab(kDepth, albedo, g).normal();
  EXPECT_NEAR(f.reflected, kDepth * albedo * backward(g), 2e-5 * kDepth);
  EXPECT_NEAR(f.transmitted - f.unscattered, kDepth * albedo * (1 - backward(g)), 2e-5 * kDepth);
}

// Little albedo: one scattering. Isotropic beams reflect albedo/2 of the integral of mu/(1 + mu)
// (1 - exp(-tau (1 + 1/mu))), and let through that of mu/(mu - 1) (exp(-tau/mu) - exp(-tau)), signs
// turned.
TEST_P(AnySlab, OfLittleAlbedoScattersOnce) {
  const double depth = GetParam().optical_depth;
  constexpr double kAlbedo = 1e-6;
  const SlabFluxes f = PlaneSlab(depth, kAlbedo).normal();
  const double back =
      integrate([&](double mu) { return mu / (1 + mu) * -std::expm1(-depth * (1 + 1 / mu)); });
  const double on = integrate(
      [&](double mu) { return mu / (1 - mu) * (std::exp(-depth) - std::exp(-depth / mu)); });
  EXPECT_NEAR(f.reflected, kAlbedo / 2 * back, 3e-6 * kAlbedo);
  EXPECT_NEAR(f.transmitted - f.unscattered, kAlbedo / 2 * on, 3e-6 * kAlbedo);
}

INSTANTIATE_TEST_SUITE_P(Media, AnySlab,
                         testing::Values(Medium{0.01, 0.5, 0}, Medium{0.2, 0.9, 0},
                                         Medium{1, 0.2, -0.4}, Medium{2, 0.9, 0.75},
                                         Medium{8, 0.99, 0.6}, Medium{100, 0.9, 0}));

TEST(PlaneSlab, RefusesWhatItCannotHold) {
  EXPECT_THROW(PlaneSlab(0, 0.5), Error);
  EXPECT_THROW(PlaneSlab(1, 1.5), Error);
  EXPECT_THROW(PlaneSlab(1, 0.5, 0.99), Error);
}

}  // namespace
}  // namespace brume::test
