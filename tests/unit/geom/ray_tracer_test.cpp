#include "geom/ray_tracer.h"

#include <gtest/gtest.h>

#include <bit>

#include "core/random.h"
#include "core/sampling.h"

namespace brume {
namespace {

TriangleMesh box_mesh(const Box3d& b) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.positions.push_back(
        {i & 1 ? b.max.x : b.min.x, i & 2 ? b.max.y : b.min.y, i & 4 ? b.max.z : b.min.z});
  // Counter-clockwise seen from outside.
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

TriangleMesh plane_mesh(double half, double z = 0) {
  TriangleMesh mesh;
  mesh.positions = {{-half, -half, z}, {half, -half, z}, {half, half, z}, {-half, half, z}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

Vec3d random_direction(RandomStream& random) { return sample_sphere(random.uniform2()); }

struct Placement {
  double size, shift;
};
class AcrossScales : public testing::TestWithParam<Placement> {
 protected:
  Box3d room() const {
    const auto [size, shift] = GetParam();
    const Vec3d centre(shift, -0.7 * shift, 0.3 * shift), half(size, 0.8 * size, 1.3 * size);
    return Box3d(centre - half, centre + half);
  }
};

// A path of bounces that ever gets out of a closed room has slipped through a wall.
TEST_P(AcrossScales, ClosedRoomNeverLeaks) {
  const RayTracer tracer({box_mesh(room())});
  RandomStream random(1);
  Vec3d origin = (room().min + room().max) * 0.5;
  Vec3d direction = random_direction(random);
  int leaks = 0, self_hits = 0;
  for (int i = 0; i < 200'000; ++i) {
    const Hit hit = tracer.intersect({origin, direction});
    if (!hit.is_hit()) {
      ++leaks;
      origin = (room().min + room().max) * 0.5;
      direction = random_direction(random);
      continue;
    }
    self_hits += i && hit.t <= 0;
    const Vec3d inside = -hit.normal;  // Faces look out.
    Vec3d next = sample_cosine_hemisphere(random.uniform2());
    if (i % 4 == 0) next = Vec3d(next.x, next.y, 1e-4).normalized();  // Grazing.
    direction = Frame(inside).to_world(next);
    origin = hit.spawn(direction);
  }
  EXPECT_EQ(leaks, 0);
  EXPECT_EQ(self_hits, 0);
}

TEST_P(AcrossScales, ShadowRaysFromWallsStayInside) {
  const RayTracer tracer({box_mesh(room())});
  RandomStream random(2);
  for (int i = 0; i < 50'000; ++i) {
    const Hit hit = tracer.point_on(0, std::uint32_t(random.uniform() * 12), [&] {
      // Near edges and corners, where leaks are.
      const double a = i % 2 ? random.uniform() * 1e-7 : random.uniform();
      return Vec2d(a, random.uniform() * (1 - a));
    }());
    const Vec3d d = Frame(-hit.normal).to_world(sample_cosine_hemisphere(random.uniform2()));
    ASSERT_TRUE(tracer.is_occluded({hit.spawn(d), d})) << i;
  }
}

TEST_P(AcrossScales, HitsLieOnTheTriangleAndTIsADistance) {
  const RayTracer tracer({box_mesh(room())});
  const auto [size, shift] = GetParam();
  RandomStream random(3);
  for (int i = 0; i < 20'000; ++i) {
    const Vec3d from =
        room().min + (room().max - room().min) * 0.5 * (1 + 0.9 * (2 * random.uniform() - 1));
    const Vec3d d = random_direction(random);
    const Hit hit = tracer.intersect({from, d});
    ASSERT_TRUE(hit.is_hit());
    const double tolerance = 1e-5 * size + 1e-14 * std::abs(shift);
    EXPECT_LT((from + d * hit.t - hit.position).length(), tolerance / std::abs(d.dot(hit.normal)));
    double to_wall = kInfinity;
    for (int a = 0; a < 3; ++a)
      to_wall = std::min({to_wall, std::abs(hit.position[a] - room().min[a]),
                          std::abs(hit.position[a] - room().max[a])});
    EXPECT_LE(to_wall, 1e-14 * (size + std::abs(shift)));
  }
}

INSTANTIATE_TEST_SUITE_P(Everywhere, AcrossScales,
                         testing::Values(Placement{1, 0}, Placement{1, 1e3}, Placement{1, 1e5},
                                         Placement{1, 1e7}, Placement{1e-5, 0},
                                         Placement{1e-5, 1e-3}, Placement{1e6, 0},
                                         Placement{1e6, 1e7}));

TEST(RayTracer, PlaneDoesNotShadowItself) {
  const RayTracer tracer({plane_mesh(100)});
  RandomStream random(4);
  int hits = 0;
  for (int i = 0; i < 1'000'000; ++i) {
    const Vec3d from(60 * random.uniform() - 30, 60 * random.uniform() - 30,
                     100 * random.uniform());
    const Hit hit = tracer.intersect(
        {from,
         (Vec3d(60 * random.uniform() - 30, 60 * random.uniform() - 30, 0) - from).normalized()});
    ASSERT_TRUE(hit.is_hit());
    Vec3d d = sample_cosine_hemisphere(random.uniform2());
    if (i % 2) d = Vec3d(d.x, d.y, 1e-5).normalized();
    hits += tracer.is_occluded({hit.spawn(d), d});
  }
  EXPECT_EQ(hits, 0);
}

TEST(RayTracer, ShiftByAPowerOfTwoChangesNothing) {
  const auto scene = [](double shift) {
    TriangleMesh ball;
    RandomStream random(5);
    for (int i = 0; i < 300; ++i) {
      // On a lattice that survives the shift exactly.
      const Vec3d p = Vec3d(random.uniform(), random.uniform(), random.uniform()) * 4096;
      ball.positions.push_back(Vec3d(std::floor(p.x), std::floor(p.y), std::floor(p.z)) / 1024 +
                               Vec3d(shift));
    }
    for (std::uint32_t i = 0; i + 2 < 300; i += 3) ball.triangles.push_back({{i, i + 1, i + 2}});
    remove_bad_triangles(ball);
    return RayTracer({ball});
  };
  const double shift = 0x1p17;
  const RayTracer here = scene(0), there = scene(shift);
  RandomStream random(6);
  int hits = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Vec3d from =
        Vec3d(std::floor(4096 * random.uniform()), std::floor(4096 * random.uniform()),
              std::floor(4096 * random.uniform())) /
        1024;
    const Vec3d d = random_direction(random);
    const Hit a = here.intersect({from, d}), b = there.intersect({from + Vec3d(shift), d});
    ASSERT_EQ(a.is_hit(), b.is_hit());
    if (!a.is_hit()) continue;
    ++hits;
    EXPECT_EQ(a.triangle, b.triangle);
    EXPECT_NEAR(a.t, b.t, 1e-9);
  }
  EXPECT_GT(hits, 1000);
}

TEST(RayTracer, FarEyeHitsTheSamePlaces) {
  const RayTracer tracer({box_mesh(Box3d({-1, -1, -1}, {1, 1, 1}))});
  for (const double far : {1e3, 1e7, 1e12}) {
    for (int i = 0; i < 100; ++i) {
      const double x = -0.95 + 1.9 * i / 99;
      const Hit hit = tracer.intersect({{x, 0.25, far}, {0, 0, -1}});
      ASSERT_TRUE(hit.is_hit()) << far;
      EXPECT_NEAR(hit.position.x, x, 1e-6);
      EXPECT_NEAR(hit.position.z, 1, 1e-12);
      EXPECT_NEAR(hit.t, far - 1, 1e-12 * far);
    }
  }
}

TEST(RayTracer, PacketsAgreeWithSingleRays) {
  const RayTracer tracer({box_mesh(Box3d({-1, -1, -1}, {1, 1, 1})),
                          box_mesh(Box3d({-0.3, -0.2, -0.1}, {0.2, 0.4, 0.3})), plane_mesh(3, -2)});
  RandomStream random(7);
  std::vector<Ray> rays;
  std::vector<ShadowRay> shadow_rays;
  for (int i = 0; i < 10'003; ++i) {
    const Vec3d from(4 * random.uniform() - 2, 4 * random.uniform() - 2, 4 * random.uniform() - 2);
    rays.push_back({from, random_direction(random)});
    shadow_rays.push_back({from, rays.back().direction, 2 * random.uniform()});
  }
  rays[17].direction = Vec3d(0.0);
  shadow_rays[17].origin.x = std::numeric_limits<double>::quiet_NaN();
  std::vector<Hit> hits(rays.size());
  std::vector<std::uint8_t> occluded(rays.size());
  tracer.intersect(rays, hits);
  tracer.is_occluded(shadow_rays, occluded);
  int different = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Hit one = tracer.intersect(rays[i]);
    ASSERT_EQ(one.is_hit(), hits[i].is_hit()) << i;
    EXPECT_EQ(tracer.is_occluded(shadow_rays[i]), occluded[i] != 0) << i;
    if (!one.is_hit()) continue;
    // On an edge either neighbour may answer.
    different += one.mesh != hits[i].mesh || one.triangle != hits[i].triangle;
    EXPECT_NEAR(one.t, hits[i].t, 1e-6);
  }
  EXPECT_LE(different, 1);
  EXPECT_FALSE(hits[17].is_hit());
  EXPECT_FALSE(occluded[17]);
}

TEST(RayTracer, OcclusionIsStrictlyBetweenTheEnds) {
  const RayTracer tracer({plane_mesh(1, 1)});
  EXPECT_FALSE(tracer.is_occluded({{0.1, 0.2, 0}, {0, 0, 1}, 1}));
  EXPECT_FALSE(tracer.is_occluded({{0.1, 0.2, 0}, {0, 0, 1}, 0.9}));
  EXPECT_TRUE(tracer.is_occluded({{0.1, 0.2, 0}, {0, 0, 1}, 1.001}));
  EXPECT_TRUE(tracer.is_occluded({{0.1, 0.2, 0}, {0, 0, 1}}));
}

TEST(RayTracer, MeshesWithoutShadowsAreSeenAllTheSame) {
  TriangleMesh card = plane_mesh(1, 1);
  card.casts_shadow = false;
  const RayTracer tracer({card, plane_mesh(1, 3)});
  EXPECT_NEAR(tracer.intersect({{0.1, 0.2, 0}, {0, 0, 1}}).t, 1, 1e-12);
  EXPECT_FALSE(tracer.is_occluded({{0.1, 0.2, 0}, {0, 0, 1}, 2}));
  EXPECT_TRUE(tracer.is_occluded({{0.1, 0.2, 0}, {0, 0, 1}, 4}));
  const std::vector<ShadowRay> rays(3, ShadowRay{{0.1, 0.2, 0}, {0, 0, 1}, 2});
  std::vector<std::uint8_t> occluded(3, 1);
  tracer.is_occluded(rays, occluded);
  EXPECT_EQ(occluded, (std::vector<std::uint8_t>{0, 0, 0}));
}

TEST(RayTracer, DegenerateTrianglesChangeNothing) {
  const TriangleMesh clean = box_mesh(Box3d({-1, -1, -1}, {1, 1, 1}));
  TriangleMesh dirty = clean;
  dirty.positions.push_back(Vec3d(std::numeric_limits<double>::quiet_NaN()));
  dirty.triangles.insert(dirty.triangles.begin() + 3, {{0, 0, 1}});
  dirty.triangles.insert(dirty.triangles.begin(), {{1, 2, 8}});
  dirty.triangles.push_back({{7, 7, 7}});
  EXPECT_EQ(remove_bad_triangles(dirty), 3u);
  const RayTracer a({clean}), b({dirty});
  RandomStream random(8);
  for (int i = 0; i < 10'000; ++i) {
    const Ray ray{{0.1, 0.2, 0.3}, random_direction(random)};
    const Hit x = a.intersect(ray), y = b.intersect(ray);
    ASSERT_EQ(x.t, y.t);
    ASSERT_EQ(x.position, y.position);
    ASSERT_EQ(x.triangle, y.triangle);
  }
}

TEST(RayTracer, EmptySceneMissesEverything) {
  const RayTracer tracer({});
  EXPECT_FALSE(tracer.intersect({{0, 0, 0}, {0, 0, 1}}).is_hit());
  EXPECT_FALSE(tracer.is_occluded({{0, 0, 0}, {0, 0, 1}}));
  EXPECT_TRUE(tracer.bounds().isEmpty());
  const std::vector<Ray> rays(3);
  std::vector<Hit> hits(3);
  tracer.intersect(rays, hits);
  EXPECT_FALSE(hits[2].is_hit());
}

TEST(RayTracer, RandomBitPatternsDoNotCrash) {
  const RayTracer tracer({box_mesh(Box3d({-1, -1, -1}, {1, 1, 1}))});
  RandomStream random(9);
  const auto any = [&] { return std::bit_cast<double>(random.bits()); };
  std::vector<Ray> rays;
  int hits = 0;
  for (int i = 0; i < 1'000'000; ++i) {
    Ray ray{{any(), any(), any()}, {any(), any(), any()}};
    if (i % 3 == 0) ray.direction = random_direction(random);
    if (i % 5 == 0) ray.origin = Vec3d(0.0);
    const double t_end = any();
    const Hit hit = tracer.intersect(ray, t_end);
    if (hit.is_hit()) {
      ++hits;
      ASSERT_TRUE(is_finite(hit.position));
    }
    tracer.is_occluded({ray.origin, ray.direction, t_end});
    rays.push_back(ray);
  }
  EXPECT_GT(hits, 1000);
  std::vector<Hit> all(rays.size());
  tracer.intersect(rays, all);
}

TEST(RayTracer, ShadingNormalsAreInterpolatedOnTheGeometricSide) {
  TriangleMesh mesh = plane_mesh(1);
  mesh.normals.assign(4, Vec3f(0.6f, 0, -0.8f));
  const RayTracer tracer({mesh});
  const Hit hit = tracer.intersect({{0.1, 0.2, 1}, {0, 0, -1}});
  EXPECT_NEAR((hit.normal - Vec3d(0, 0, 1)).length(), 0, 1e-12);
  EXPECT_NEAR((hit.shading_normal - Vec3d(-0.6, 0, 0.8)).length(), 0, 1e-6);
}

// What lies near stays as exact however far a ground or a stray triangle goes.
TEST(RayTracer, FarGroundCostsNoDigits) {
  const Box3d box({-0.3, -0.2, 0}, {0.4, 0.3, 0.5});
  for (const double half : {10.0, 1e3, 1e5}) {
    const RayTracer tracer({plane_mesh(half), box_mesh(box)});
    EXPECT_LT(tracer.centre().length(), 1) << half;
    RandomStream random(3);
    for (int i = 0; i < 20'000; ++i) {
      const Vec2d u = random.uniform2();
      const Vec3d above(4 * u.x - 2, 4 * u.y - 2, 1e-3);
      if (box.intersects(above)) continue;
      const Hit hit = tracer.intersect({above, {0, 0, -1}});
      ASSERT_TRUE(hit.is_hit());
      ASSERT_EQ(hit.position.z, 0);
      ASSERT_LT(hit.offset, 2e-4) << half;
      // From there no ray upwards meets the ground again.
      const Vec3d w = sample_cosine_hemisphere(random.uniform2());
      const Hit next = tracer.intersect({hit.spawn(w), w});
      ASSERT_TRUE(!next.is_hit() || next.mesh == 1) << half;
    }
    const Hit far = tracer.intersect({{0.7 * half, 0.3 * half, 1}, {0, 0, -1}});
    EXPECT_NEAR(far.t, 1, 1e-9);
    EXPECT_NEAR(far.position.x, 0.7 * half, 1e-9 * half);
  }
}

// Cut triangles have no gaps between their parts, nor to those that are not cut.
TEST(RayTracer, ACutTriangleIsWhole) {
  TriangleMesh ground;
  const double far = 3e4;
  ground.positions = {
      {-far, -far, 0}, {far, -far, 0}, {0.2, far, 0}, {-far, far, 0}, {far, far, 0}};
  ground.triangles = {{0, 1, 2}, {0, 2, 3}, {1, 4, 2}};
  const RayTracer tracer({ground, box_mesh(Box3d({-1, -1, 1}, {1, 1, 2}))});
  RandomStream random(4);
  for (int i = 0; i < 200'000; ++i) {
    const Vec2d u = random.uniform2();
    const double reach = far * std::exp(-12 * random.uniform());
    const Vec3d from((2 * u.x - 1) * reach, (2 * u.y - 1) * reach, 0.5);
    const Hit hit = tracer.intersect({from, {0, 0, -1}});
    ASSERT_TRUE(hit.is_hit()) << from.x << ' ' << from.y;
    ASSERT_NEAR(hit.position.x, from.x, 2 * hit.offset);  // Edges are kept clear of.
  }
}

TEST(RayTracer, PointsSeeEachOtherUnlessASurfaceIsBetween) {
  TriangleMesh wall;
  wall.positions = {{1, -2, 0}, {1, 2, 0}, {1, 2, 3}, {1, -2, 3}};
  wall.triangles = {{0, 1, 2}, {0, 2, 3}};
  wall.casts_shadow = false;  // It hides all the same.
  const RayTracer tracer({plane_mesh(5), wall, plane_mesh(0.5, 0.2)});
  const Vec3d up(0, 0, 1);
  EXPECT_TRUE(tracer.sees({-2, 0, 0}, up, {-1, 1, 0}, up));
  EXPECT_FALSE(tracer.sees({0.9, 1, 0}, up, {1.1, 1, 0}, up));    // A wall without thickness.
  EXPECT_TRUE(tracer.sees({0.9, 3, 0}, up, {1.1, 3, 0}, up));     // Beside it.
  EXPECT_FALSE(tracer.sees({0.1, 0, 0}, up, {0.1, 0, 0.2}, up));  // A shelf over the ground.
  EXPECT_FALSE(tracer.sees({0.1, 0, 0.2}, up, {0.4, 0, 0}, up));
  EXPECT_TRUE(tracer.sees({0.1, 0, 0}, up, {0.4, 0, 0}, up));  // Below the shelf.
}

// Over a convex surface the straight way leads through it; the points see each other all the same.
TEST(RayTracer, NeighboursOnASphereSeeEachOther) {
  TriangleMesh ball;
  constexpr int kRings = 48, kSides = 96;
  for (int i = 0; i <= kRings; ++i)
    for (int k = 0; k < kSides; ++k) {
      const double theta = kPi * i / kRings, phi = 2 * kPi * k / kSides;
      const Vec3d p(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                    std::cos(theta));
      ball.positions.push_back(p);
      ball.normals.push_back(Vec3f(p));
    }
  for (std::uint32_t i = 0; i < kRings; ++i)
    for (std::uint32_t k = 0; k < kSides; ++k) {
      const std::uint32_t a = i * kSides + k, b = i * kSides + (k + 1) % kSides;
      ball.triangles.push_back({a, a + kSides, b});
      ball.triangles.push_back({b, a + kSides, b + kSides});
    }
  remove_bad_triangles(ball);
  const RayTracer tracer({ball});
  RandomStream random(5);
  int seen = 0, asked = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vec3d n = random_direction(random);
    const Hit a = tracer.intersect({n * 2, -n});
    const Frame frame(n);
    const Vec2d u = random.uniform2();
    const Vec3d m = (n + (frame.u * (u.x - 0.5) + frame.v * (u.y - 0.5)) * 0.8).normalized();
    const Hit b = tracer.intersect({m * 2, -m});
    if (!a.is_hit() || !b.is_hit()) continue;
    ++asked;
    seen += tracer.sees(a.position, a.shading_normal, b.position, b.shading_normal);
  }
  EXPECT_GT(seen, 0.98 * asked) << asked;
}

// Brute force over the part of each triangle that is above the plane.
TEST(RayTracer, ClearanceIsTheNearestThatRises) {
  const Vec3d up(0, 0, 1);
  const RayTracer ground({plane_mesh(1e4)});
  EXPECT_EQ(ground.clearance({1, 2, 0}, up), kInfinity);
  TriangleMesh wall;
  wall.positions = {{1, -2, -1}, {1, 2, -1}, {1, 2, 3}, {1, -2, 3}};
  wall.triangles = {{0, 1, 2}, {0, 2, 3}};
  const RayTracer tracer({plane_mesh(1e4), wall, plane_mesh(0.5, 0.2)});
  EXPECT_NEAR(tracer.clearance({-3, 0, 0}, up), std::hypot(2.5, 0.2), 1e-6);
  EXPECT_NEAR(tracer.clearance({0.1, 0.2, 0}, up), 0.2, 1e-6);  // Under the shelf.
  EXPECT_NEAR(tracer.clearance({0.9, 1.5, 0}, up), 0.1, 1e-4);
  EXPECT_NEAR(tracer.clearance({2.5, 0, 0}, up), 1.5, 1e-4);
  EXPECT_NEAR(tracer.clearance({0, 0, 0}, -up), 1, 1e-6);  // Below the ground only the wall.
  EXPECT_NEAR(tracer.clearance({50, 0, 0.1}, -up), 0.1, 1e-6);
}

}  // namespace
}  // namespace brume
