// Which points stand for the others.
#include "bake/placement.h"

#include <gtest/gtest.h>

#include "core/random.h"

namespace brume {
namespace {

// In a cube, of footprints over three powers of ten, on surfaces of two orientations.
std::vector<SurfacePoint> random_points(std::size_t count) {
  RandomStream random(7);
  std::vector<SurfacePoint> points;
  for (std::size_t i = 0; i < count; ++i) {
    SurfacePoint p;
    p.position = Vec3d(random.uniform(), random.uniform(), random.uniform()) * 0.4 - Vec3d(0.2);
    p.normal = random.uniform() < 0.5 ? Vec3d(0, 0, 1) : Vec3d(1, 0, 0);
    p.min_radius = std::pow(10, -3 * random.uniform()) * 0.5;
    points.push_back(p);
  }
  return points;
}

// Against asking every point kept before.
TEST(Placement, ThinnedPointsKeepTheirDistances) {
  constexpr double kPart = 0.7;
  std::vector<SurfacePoint> points = random_points(3000);
  const std::vector<SurfacePoint> thinned = thin_by_footprint(points, kPart, points.size());
  std::stable_sort(points.begin(), points.end(), [](const SurfacePoint& a, const SurfacePoint& b) {
    return a.min_radius > b.min_radius;
  });
  std::vector<SurfacePoint> expected;
  for (const SurfacePoint& p : points)
    if (std::none_of(expected.begin(), expected.end(), [&](const SurfacePoint& k) {
          return (k.position - p.position).length() < kPart * p.min_radius &&
                 k.normal.dot(p.normal) > kMaxNormalCosine;
        }))
      expected.push_back(p);
  ASSERT_EQ(thinned.size(), expected.size());
  EXPECT_LT(thinned.size(), points.size() * 9 / 10);
  for (std::size_t i = 0; i < thinned.size(); ++i)
    EXPECT_EQ(thinned[i].position, expected[i].position);
  const std::vector<SurfacePoint> few = thin_by_footprint(points, kPart, 50);
  ASSERT_EQ(few.size(), 50u);
  for (std::size_t i = 0; i < few.size(); ++i) EXPECT_EQ(few[i].position, thinned[i].position);
}

}  // namespace
}  // namespace brume
