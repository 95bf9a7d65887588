#include "data_gen/analytic_field.h"

#include <gtest/gtest.h>

#include <string>

#include "core/error.h"
#include "core/random.h"

namespace brume {
namespace {

struct NamedField {
  std::string name;
  AnalyticField field;
};

class ClosedForms : public testing::TestWithParam<NamedField> {
 protected:
  const AnalyticField& field() const { return GetParam().field; }
  Vec3d random_point() {
    return {random_.uniform() * 3 - 1.5, random_.uniform() * 3 - 1.5, random_.uniform() * 3 - 1.5};
  }

  RandomStream random_{42};
};

// Midpoint rule in double: exact but for the steps that hold a jump, of which a way meets two.
double summed(const AnalyticField& field, const Vec3d& a, const Vec3d& b, int steps) {
  double sum = 0;
  for (int i = 0; i < steps; ++i) sum += density(field, a + (b - a) * ((i + 0.5) / steps));
  return sum * (b - a).length() / steps;
}

TEST_P(ClosedForms, LineIntegralIsTheSumOfDensities) {
  constexpr int kSteps = 20'000;
  for (int i = 0; i < 40; ++i) {
    const Vec3d a = random_point(), b = random_point();
    const double length = (b - a).length();
    EXPECT_NEAR(line_integral(field(), a, b).value(), summed(field(), a, b, kSteps),
                1e-7 + 3.0 * length / kSteps)
        << a << " to " << b;
  }
}

TEST_P(ClosedForms, LineIntegralsOfPartsAddUp) {
  for (int i = 0; i < 40; ++i) {
    const Vec3d a = random_point(), b = random_point(), m = a + (b - a) * random_.uniform();
    EXPECT_NEAR(*line_integral(field(), a, m) + *line_integral(field(), m, b),
                *line_integral(field(), a, b), 1e-12);
    EXPECT_NEAR(*line_integral(field(), b, a), *line_integral(field(), a, b), 1e-12);
  }
  const Vec3d p = random_point();
  EXPECT_EQ(*line_integral(field(), p, p), 0);
}

TEST_P(ClosedForms, GradientIsTheSlopeOfDensity) {
  constexpr double kStep = 1e-5;
  for (int i = 0; i < 200; ++i) {
    const Vec3d p = random_point();
    const Vec3d gradient = density_gradient(field(), p).value();
    for (int axis = 0; axis < 3; ++axis) {
      Vec3d d(0.0);
      d[axis] = kStep;
      const double above = density(field(), p + d), below = density(field(), p - d);
      EXPECT_NEAR(gradient[axis], (above - below) / (2 * kStep), 1e-8) << p;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Fields, ClosedForms,
    testing::Values(NamedField{"Box", ConstantBox{{{-0.5, -0.7, -0.2}, {0.6, 0.4, 0.9}}, 0.7}},
                    NamedField{"Ball", ConstantBall{{0.1, -0.2, 0.3}, 0.8, 0.9}},
                    NamedField{"Ramp", LinearRamp{0.3, {0.5, -0.2, 0.1}}},
                    NamedField{"Atmosphere",
                               ExponentialAtmosphere{0.6, 1.3, -0.4, Vec3d(1, 2, -1).normalized()}},
                    NamedField{"Gaussians", three_gaussians(0.1)}),
    [](const auto& instance) { return instance.param.name; });

TEST(ConstantBox, MeasuresAWayAlongItsAxesOfEitherSign) {
  const ConstantBox box{{Vec3d(0.0), Vec3d(1.0)}, 2};
  EXPECT_DOUBLE_EQ(*line_integral(box, {-1, 0.5, 0.5}, {3, 0.5, 0.5}), 2);
  EXPECT_DOUBLE_EQ(*line_integral(box, {3, 0.5, 0.5}, {-1, 0.5, 0.5}), 2);
  EXPECT_DOUBLE_EQ(*line_integral(box, {0.5, 0.25, 0.5}, {0.5, 0.75, 0.5}), 1);
  EXPECT_EQ(*line_integral(box, {-1, 1.5, 0.5}, {3, 1.5, 0.5}), 0);
}

// Case A6 of the reference cases.
TEST(GaussianSum, HasThePublishedOpticalDepth) {
  EXPECT_NEAR(*line_integral(three_gaussians(0.1), {-0.6, 0.25, 0}, {0.9, -0.2, 1.3}),
              1.517517640009, 1e-12);
}

TEST(ExponentialAtmosphere, IsExactOnALevelWayAndNearOne) {
  const ExponentialAtmosphere air{0.5, 2, 0, {0, 1, 0}};
  EXPECT_DOUBLE_EQ(*line_integral(air, {0, 0, 0}, {3, 0, 0}), 1.5);
  // 1 - exp(-x) of x = 5e-10 has lost nine digits; the series has not.
  EXPECT_NEAR(*line_integral(air, {0, 0, 0}, {3, 1e-9, 0}) / 1.5 - 1, -2.5e-10, 1e-14);
}

TEST(Noises, HaveNoClosedForm) {
  for (const AnalyticField& field : {AnalyticField(SmokePlume{}), AnalyticField(Dust{})}) {
    EXPECT_FALSE(line_integral(field, {0, 0, 0}, {1, 1, 1}));
    EXPECT_FALSE(density_gradient(field, {0, 0, 0}));
  }
}

TEST(CoveringLattice, EndsOnTheFarFaceWhereTheStepDividesTheExtent) {
  const Lattice lattice = covering_lattice({{-2, -2, 0}, {2, 2, 2.5}}, 0.25);
  EXPECT_EQ(lattice.count, Vec3i(17, 17, 11));
  EXPECT_EQ(lattice.node({16, 16, 10}), Vec3d(2, 2, 2.5));
  EXPECT_EQ(lattice.index_to_world().point({4, 0, 2}), lattice.node({4, 0, 2}));
  EXPECT_EQ(covering_lattice({{-2, -2, 0}, {2, 2, 2.5}}, 0.05).count, Vec3i(81, 81, 51));
}

TEST(CoveringLattice, ReachesPastAFaceThatTheStepDoesNotMeet) {
  const Lattice lattice = covering_lattice({Vec3d(0.0), Vec3d(1.0)}, 0.3);
  EXPECT_EQ(lattice.count, Vec3i(5));
}

TEST(CoveringLattice, RefusesWhatIsNoLattice) {
  const Box3d unit(Vec3d(0.0), Vec3d(1.0));
  for (const double step : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), kInfinity, 1e-9})
    EXPECT_THROW(covering_lattice(unit, step), Error) << step;
  EXPECT_THROW(covering_lattice(Box3d(), 0.1), Error);
  EXPECT_THROW(covering_lattice({Vec3d(0.0), Vec3d(1, 0, 1)}, 0.1), Error);
  EXPECT_THROW(covering_lattice({Vec3d(0.0), Vec3d(kInfinity)}, 0.1), Error);
}

TEST(SampleField, HasXFastestAndTheFieldsValues) {
  const LinearRamp ramp{1, {0.5, 0.25, 0.125}};
  const Lattice lattice{{0, 0, 0}, 0.5, {3, 4, 5}};
  const std::vector<float> values = sample_field(ramp, lattice);
  ASSERT_EQ(values.size(), 60u);
  for (int k = 0; k < 5; ++k)
    for (int j = 0; j < 4; ++j)
      for (int i = 0; i < 3; ++i)
        EXPECT_EQ(values[(k * 4 + j) * 3 + i], float(density(ramp, lattice.node({i, j, k}))));
}

TEST(SampleField, IsTheSameForAnyNumberOfThreads) {
  SmokePlume plume;
  plume.source = {0, -1, 0};
  const Lattice lattice = covering_lattice({Vec3d(-1.0), Vec3d(1.0)}, 0.125);
  const std::vector<float> one = sample_field(plume, lattice, 1);
  EXPECT_EQ(one, sample_field(plume, lattice, 2));
  EXPECT_EQ(one, sample_field(plume, lattice, 7));
}

}  // namespace
}  // namespace brume
