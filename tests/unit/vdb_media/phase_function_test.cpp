#include "vdb_media/phase_function.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/random.h"
#include "core/sampling.h"

namespace brume {
namespace {

// Integrates f(cos) over the sphere, in double. The lobe is resolved by walking w = 1 - |cos| in
// powers: near the pole of the lobe as finely as it is narrow.
template <typename F>
double integrate_sphere(F f) {
  constexpr int kSteps = 40'000;
  double sum = 0;
  for (const double side : {1.0, -1.0}) {
    double w0 = 0;
    for (int i = 1; i <= kSteps; ++i) {
      const double x = double(i) / kSteps;
      const double w1 = x * x * x * x;
      const double w = (w0 + w1) / 2;
      sum += f(w, side) * (w1 - w0);
      w0 = w1;
    }
  }
  return 2 * kPi * sum;
}

// The direction whose 1 - side cos is w, without the digits that cos itself would lose.
Vec3d at_angle(const Vec3d& in, double w, double side) {
  const Frame frame(in);
  return in * (side * (1 - w)) + frame.u * std::sqrt(w * (2 - w));
}

class HenyeyGreensteinTest : public testing::TestWithParam<double> {
 protected:
  double g() const { return GetParam(); }
  HenyeyGreenstein phase_{GetParam()};
  Vec3d in_ = Vec3d(1, 2, -2).normalized();
};

TEST_P(HenyeyGreensteinTest, IntegratesToOne) {
  EXPECT_NEAR(integrate_sphere(
                  [&](double w, double side) { return phase_.eval(in_, at_angle(in_, w, side)); }),
              1, 1e-4);
}

TEST_P(HenyeyGreensteinTest, MeanCosineIsG) {
  EXPECT_NEAR(integrate_sphere([&](double w, double side) {
                return side * (1 - w) * phase_.eval(in_, at_angle(in_, w, side));
              }),
              g(), 1e-4);
}

TEST_P(HenyeyGreensteinTest, IsReciprocal) {
  RandomStream random(random_key(1));
  for (int i = 0; i < 1000; ++i) {
    const Vec3d a = sample_sphere(random.uniform2()), b = sample_sphere(random.uniform2());
    EXPECT_EQ(phase_.eval(a, b), phase_.eval(b, a));
    // Turning both round is the same pair of paths.
    EXPECT_DOUBLE_EQ(phase_.eval(-a, -b), phase_.eval(a, b));
  }
}

TEST_P(HenyeyGreensteinTest, StrataHaveTheRightMeanAndDensity) {
  constexpr int kStrata = 4096;
  double mean_cosine = 0;
  for (int i = 0; i < kStrata; ++i) {
    const PhaseSample s = phase_.sample(in_, {(i + 0.5) / kStrata, 0.8});
    EXPECT_NEAR(s.direction.length(), 1, 1e-14);
    EXPECT_EQ(s.pdf, phase_.eval(in_, s.direction));
    mean_cosine += in_.dot(s.direction) / kStrata;
  }
  EXPECT_NEAR(mean_cosine, g(), 2e-4);
}

TEST_P(HenyeyGreensteinTest, DerivativeIsThatOfEval) {
  for (const double w : {1e-4, 0.01, 0.3, 1.0}) {
    const double side = g() < 0 ? -1 : 1, h = 1e-5 * w;
    const auto p = [&](double at) { return phase_.eval(in_, at_angle(in_, at, side)); };
    // cos = side (1 - w).
    const double difference = -side * (p(w + h) - p(w - h)) / (2 * h);
    EXPECT_NEAR(phase_.eval_with_derivative(in_, at_angle(in_, w, side)).derivative, difference,
                1e-6 * std::abs(difference) + 1e-8);
  }
}

// HARD_CASES 4.2: the formula in long double, with 1 - cos from the vectors as they are.
TEST_P(HenyeyGreensteinTest, KeepsItsDigits) {
  for (double w = 1e-12; w < 2; w *= 1.5) {
    const Vec3d out = at_angle(in_, w, 1);
    using Long = long double;
    Long difference = 0;
    for (int a = 0; a < 3; ++a) {
      const Long d = Long(in_[a]) - Long(out[a]);
      difference += d * d;
    }
    const Long gl = g(), den = (1 - gl) * (1 - gl) + gl * difference;
    const Long expected = (1 - gl * gl) / (4 * std::numbers::pi_v<Long> * den * std::sqrt(den));
    // For g < 0 the other half of the sphere is measured from the opposite pole.
    const double tolerance = g() < 0 && w > 1.9 ? 1e-6 : 4e-7;
    EXPECT_NEAR(phase_.eval(in_, out) / double(expected), 1, tolerance) << w;
  }
}

INSTANTIATE_TEST_SUITE_P(AcrossG, HenyeyGreensteinTest,
                         testing::Values(-0.999, -0.99, -0.9, -0.5, -1e-4, 0.0, 1e-4, 0.3, 0.5, 0.9,
                                         0.99, 0.999));

// gradients.md 7.6, whose g are floats.
TEST(HenyeyGreenstein, KnownValuesOfNarrowLobes) {
  const Vec3d in(0, 0, 1), out(std::sin(1e-4), 0, std::cos(1e-4));
  EXPECT_NEAR(HenyeyGreenstein(0.999f).eval(in, out), 156725, 1e-3 * 156725);
  EXPECT_NEAR(HenyeyGreenstein(0.99999f).eval(in, out), 1.57005e6, 1e-3 * 1.57005e6);
  EXPECT_NEAR(HenyeyGreenstein(-0.999f).eval(in, -out), 156725, 1e-3 * 156725);
}

TEST(HenyeyGreenstein, IsotropicIsUniform) {
  const HenyeyGreenstein phase;
  EXPECT_TRUE(phase.is_isotropic());
  EXPECT_DOUBLE_EQ(phase.eval(Vec3d(0, 0, 1), Vec3d(0, 1, 0)), 1 / (4 * kPi));
  EXPECT_EQ(phase.eval_with_derivative(Vec3d(0, 0, 1), Vec3d(0, 1, 0)).derivative, 0);
}

TEST(HenyeyGreenstein, EndsOfTheSquareAreFinite) {
  for (const double g : {-0.99999, 0.0, 0.99999})
    for (const double u : {0.0, 0x1.fffffffffffffp-1}) {
      const PhaseSample s = HenyeyGreenstein(g).sample(Vec3d(0, 0, -1), {u, u});
      EXPECT_TRUE(is_finite(s.direction) && std::isfinite(s.pdf) && s.pdf > 0) << g << " " << u;
    }
}

TEST(HenyeyGreenstein, RefusesGOutsideTheOpenInterval) {
  for (const double g : {-1.0, 1.0, 1.5, double(NAN), kInfinity})
    EXPECT_THROW(HenyeyGreenstein{g}, Error) << "g = " << g;
}

}  // namespace
}  // namespace brume
