#include "core/math.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "core/sampling.h"

namespace brume {
namespace {

Affine3d random_map(RandomStream& random) {
  Affine3d m;
  for (auto& row : m.m)
    for (double& v : row) v = 4 * random.uniform() - 2;
  return m;
}

void expect_near(const Vec3d& a, const Vec3d& b, double tolerance) {
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(a[k], b[k], tolerance) << "component " << k;
}

TEST(Affine3d, InverseUndoesTheMap) {
  RandomStream random(1);
  for (int i = 0; i < 200; ++i) {
    const Affine3d m = random_map(random);
    if (std::abs(m.determinant()) < 0.1) continue;
    const std::optional<Affine3d> inverse = m.inverse();
    ASSERT_TRUE(inverse);
    const Vec3d p(random.uniform(), random.uniform(), random.uniform());
    expect_near(inverse->point(m.point(p)), p, 1e-12);
    expect_near(m.point(inverse->point(p)), p, 1e-12);
  }
}

TEST(Affine3d, InverseOfAKnownMap) {
  Affine3d m;
  m.m = {{{0, -2, 0, 3}, {2, 0, 0, 5}, {0, 0, 4, -7}}};  // A quarter turn, scale, move.
  const Affine3d inverse = m.inverse().value();
  expect_near(inverse.point({3, 5, -7}), {0, 0, 0}, 0);
  expect_near(inverse.point({3, 7, -3}), {1, 0, 1}, 1e-15);
}

TEST(Affine3d, SingularAndNonFiniteMapsHaveNoInverse) {
  Affine3d m;
  m.m[2] = m.m[1];
  EXPECT_FALSE(m.inverse());
  m.m[2] = {0, 0, std::numeric_limits<double>::quiet_NaN(), 0};
  EXPECT_FALSE(m.inverse());
  m.m[2] = {0, 0, kInfinity, 0};
  EXPECT_FALSE(m.inverse());
}

TEST(Affine3d, ProductAppliesTheRightOneFirst) {
  RandomStream random(2);
  const Affine3d a = random_map(random), b = random_map(random);
  const Vec3d p(0.3, -0.7, 2);
  expect_near((a * b).point(p), a.point(b.point(p)), 1e-12);
  EXPECT_NEAR((a * b).determinant(), a.determinant() * b.determinant(), 1e-9);
}

TEST(Affine3d, TransposeTakesGradientsBack) {
  // f(p) = g . (M p), so its gradient is M^T g.
  RandomStream random(3);
  const Affine3d m = random_map(random);
  const Vec3d g(1, -2, 0.5), v(0.1, 0.9, -0.4);
  EXPECT_NEAR(g.dot(m.vector(v)), m.transposed_vector(g).dot(v), 1e-12);
}

TEST(Affine3d, BoxHoldsTheImagesOfAllCorners) {
  RandomStream random(4);
  const Affine3d m = random_map(random);
  const Box3d box(Vec3d(-1, 0, 2), Vec3d(1, 3, 5));
  Box3d image = m.box(box);
  for (int i = 0; i < 100; ++i) {
    const Vec3d p(-1 + 2 * random.uniform(), 3 * random.uniform(), 2 + 3 * random.uniform());
    EXPECT_TRUE(image.intersects(m.point(p)));
  }
}

void expect_frame(const Vec3d& n) {
  const Frame f(n);
  const double tolerance = 1e-14;
  EXPECT_NEAR(f.u.length(), 1, tolerance) << n;
  EXPECT_NEAR(f.v.length(), 1, tolerance) << n;
  EXPECT_NEAR(f.u.dot(f.v), 0, tolerance) << n;
  EXPECT_NEAR(f.u.dot(n), 0, tolerance) << n;
  EXPECT_NEAR(f.v.dot(n), 0, tolerance) << n;
  expect_near(f.u.cross(f.v), n, tolerance);  // Right-handed.
  expect_near(f.to_world({0, 0, 1}), n, 0);
  const Vec3d d(0.48, -0.6, 0.64);
  expect_near(f.to_local(f.to_world(d)), d, tolerance);
}

TEST(Frame, IsOrthonormalAndRightHandedForEveryNormal) {
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {1.0, -1.0})
      for (const double zero : {0.0, -0.0}) {
        Vec3d n(zero);
        n[axis] = sign;
        expect_frame(n);
      }
  RandomStream random(5);
  for (int i = 0; i < 10000; ++i) expect_frame(sample_sphere(random.uniform2()).normalized());
  // Around the poles, where older constructions lose their digits.
  for (const double sign : {1.0, -1.0})
    for (double e = 1e-1; e > 1e-18; e /= 10) expect_frame(Vec3d(e, -e, sign).normalized());
}

// HARD_CASES N03: zero components of both signs, faces, edges, corners.
const Box3d kUnit(Vec3d(0.0), Vec3d(1.0));

TEST(Clip, FindsTheCrossing) {
  const Interval t = clip({{-1, 0.5, 0.5}, {1, 0, 0}}, kUnit, {});
  EXPECT_EQ(t.begin, 1);
  EXPECT_EQ(t.end, 2);
}

TEST(Clip, TreatsBothZerosAlike) {
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {1.0, -1.0})
      for (const double zero : {0.0, -0.0}) {
        Vec3d direction(zero), origin(0.25);
        direction[axis] = sign;
        origin[axis] = sign > 0 ? -2 : 3;
        const Interval t = clip({origin, direction}, kUnit, {});
        EXPECT_EQ(t.begin, 2);
        EXPECT_EQ(t.end, 3);
        origin[(axis + 1) % 3] = 1.5;  // Beside the box.
        EXPECT_TRUE(clip({origin, direction}, kUnit, {}).is_empty());
      }
}

TEST(Clip, FacesAreHalfOpen) {
  for (const double zero : {0.0, -0.0}) {
    EXPECT_FALSE(clip({{-1, 0, 0.5}, {1, zero, zero}}, kUnit, {}).is_empty()) << "on the lower face";
    EXPECT_TRUE(clip({{-1, 1, 0.5}, {1, zero, zero}}, kUnit, {}).is_empty()) << "on the upper face";
    EXPECT_FALSE(clip({{-1, 0, 0}, {1, zero, zero}}, kUnit, {}).is_empty()) << "along an edge";
  }
}

TEST(Clip, StartsInsideEndsAtLimitsAndMisses) {
  const Ray ray{{0.5, 0.5, 0.5}, {0, 0, 1}};
  EXPECT_EQ(clip(ray, kUnit, {}).begin, 0);
  EXPECT_EQ(clip(ray, kUnit, {}).end, 0.5);
  EXPECT_EQ(clip(ray, kUnit, {0.1, 0.2}).end, 0.2);
  EXPECT_TRUE(clip(ray, kUnit, {0.6, 1}).is_empty());
  EXPECT_TRUE(clip({{0.5, 0.5, 2}, {0, 0, 1}}, kUnit, {}).is_empty()) << "behind";
  const double d = 1 / std::sqrt(3.0);
  const Interval diagonal = clip({{-1, -1, -1}, {d, d, d}}, kUnit, {});
  EXPECT_NEAR(diagonal.begin, std::sqrt(3.0), 1e-12);
  EXPECT_NEAR(diagonal.end, 2 * std::sqrt(3.0), 1e-12);
  EXPECT_TRUE(clip({{-1, 0, 0.5}, Vec3d(1, -1, 0).normalized()}, kUnit, {}).is_empty()) << "by the edge";
}

TEST(Clip, AgreesWithPointsAlongTheRay) {
  RandomStream random(6);
  for (int i = 0; i < 2000; ++i) {
    const Ray ray{{4 * random.uniform() - 2, 4 * random.uniform() - 2, 4 * random.uniform() - 2},
                  sample_sphere(random.uniform2()).normalized()};
    const Interval t = clip(ray, kUnit, {});
    for (int k = 0; k < 20; ++k) {
      const double at = 6 * random.uniform();
      const Vec3d p = ray.at(at);
      const bool inside = kUnit.intersects(p);
      const double to_ends = std::min(std::abs(at - t.begin), std::abs(at - t.end));
      if (!t.is_empty() && to_ends < 1e-9) continue;
      EXPECT_EQ(inside, !t.is_empty() && at > t.begin && at < t.end);
    }
  }
}

TEST(RgbGradient, OuterProductChangesAlongItsVector) {
  const RgbGradient g = outer(RgbD(1, 2, 3), {0, 2, 0});
  EXPECT_EQ(g.dot({5, 1, 5}), RgbD(2, 4, 6));
  EXPECT_NEAR(luminance(g).y, 2 * luminance(RgbD(1, 2, 3)), 1e-12);
}

TEST(Math, OneMinusExpOverIsSmoothThroughZero) {
  EXPECT_EQ(one_minus_exp_over(0), 1);
  // The series 1 - x/2 + x^2/6 - x^3/24 around the switch.
  for (const double x : {1e-12, 9.9e-5, 1.01e-4, 1e-3})
    EXPECT_NEAR(one_minus_exp_over(x), 1 - x / 2 + x * x / 6 - x * x * x / 24, 3e-9) << x;
  EXPECT_NEAR(one_minus_exp_over(2), (1 - std::exp(-2.0)) / 2, 1e-15);
  EXPECT_NEAR(one_minus_exp_over(800), 1.0 / 800, 1e-15);
}

TEST(Sampling, MomentsOfTheDirections) {
  Vec3d cosine(0.0), sphere(0.0), sphere2(0.0);
  constexpr int kSide = 200;
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const Vec2d u((i + 0.5) / kSide, (j + 0.5) / kSide);
      const Vec3d c = sample_cosine_hemisphere(u), s = sample_sphere(u);
      EXPECT_NEAR(c.length(), 1, 1e-12);
      EXPECT_GE(c.z, 0);
      cosine += c / (kSide * kSide);
      sphere += s / (kSide * kSide);
      sphere2 += s * s / (kSide * kSide);
    }
  expect_near(cosine, {0, 0, 2.0 / 3}, 1e-4);  // Integral of cos^2 / pi.
  expect_near(sphere, {0, 0, 0}, 1e-12);
  expect_near(sphere2, Vec3d(1.0 / 3), 1e-4);
}

TEST(Sampling, TrianglePointsAreInsideAndAverageToTheCentroid) {
  Vec2d mean(0.0);
  constexpr int kSide = 200;
  for (int i = 0; i < kSide; ++i)
    for (int j = 0; j < kSide; ++j) {
      const Vec2d b = sample_triangle({(i + 0.5) / kSide, (j + 0.5) / kSide});
      EXPECT_GE(b.x, 0);
      EXPECT_GE(b.y, 0);
      EXPECT_LE(b.x + b.y, 1 + 1e-12);
      mean += b / (kSide * kSide);
    }
  EXPECT_NEAR(mean.x, 1.0 / 3, 1e-4);
  EXPECT_NEAR(mean.y, 1.0 / 3, 1e-4);
}

}  // namespace
}  // namespace brume
