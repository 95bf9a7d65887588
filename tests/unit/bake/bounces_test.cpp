// Bounces against the geometric series of a closed diffuse box: every wall glows with radiance 1,
// seen by gathers only, and reflects rho, so after l reflections E = pi (1 - rho^(l+1)) / (1 -
// rho).
#include <gtest/gtest.h>

#include "bake/deep_bake.h"
#include "core/random.h"
#include "support/smoky_rooms.h"

namespace brume {
namespace {

using test::Stage;

Scene furnace(float rho) {
  Scene scene;
  Material wall = test::gathered_emitter(1);
  wall.albedo = Rgb(rho);
  test::add_room(scene, test::kUnitBox, test::add_material(scene, wall));
  return scene;
}

struct Range {
  double least = kInfinity, most = 0, mean = 0;
  std::size_t count = 0;
};

// Of the records that face into the box.
Range irradiance_inside(const IrradianceCache& cache, int layer) {
  Range range;
  for (const SurfaceRecord& r : cache.records()) {
    if (r.layer() != layer) continue;
    const Vec3d p = Vec3d(r.position[0], r.position[1], r.position[2]) + cache.origin();
    const Vec3d n(r.normal[0], r.normal[1], r.normal[2]);
    if (n.dot(Vec3d(0.5) - p) < 0) continue;
    range.least = std::min<double>(range.least, r.irradiance[1]);
    range.most = std::max<double>(range.most, r.irradiance[1]);
    range.mean += r.irradiance[1];
    ++range.count;
  }
  range.mean /= std::max<std::size_t>(1, range.count);
  return range;
}

double series(double rho, int reflections) {
  return kPi * (1 - std::pow(rho, reflections + 1)) / (1 - rho);
}

TEST(Bounces, FollowTheGeometricSeries) {
  const double rho = 0.6;
  for (const int bounces : {1, 2, 3, 4}) {
    const Stage stage(furnace(static_cast<float>(rho)), test::coarse_settings(bounces));
    const BakeResult baked = stage.bake_everywhere();
    EXPECT_EQ(baked.deep.orders, bounces - 1);
    EXPECT_EQ(baked.deep.truncation_bound, 0);
    for (const int layer : {kDeepLayer, kTopLayer}) {
      const Range e = irradiance_inside(*baked.cache, layer);
      const double expected = series(rho, layer == kTopLayer ? bounces : bounces - 1);
      EXPECT_GT(e.count, 50u);
      EXPECT_NEAR(e.mean, expected, 0.003 * expected) << "layer " << layer << " of " << bounces;
      // A record 1e-5 from an edge has neighbours whose gradients are noise over so short a way.
      EXPECT_GT(e.least, 0.985 * expected) << "layer " << layer << " of " << bounces;
      EXPECT_LT(e.most, 1.01 * expected) << "layer " << layer << " of " << bounces;
    }
  }
}

// Without a glow one bounce needs no deep records: E_1 is the reflection of direct light.
TEST(Bounces, DirectLightIsReflectedOnceMoreByEach) {
  Scene scene;
  test::add_room(scene, test::kUnitBox, test::add_material(scene, test::diffuse(0.5f)));
  scene.lights.emplace_back(PointLight{{0.5, 0.5, 0.5}, Rgb(1.0f)});
  // All of 4 pi W fall on the walls, half of what falls is reflected, and nothing leaves.
  double reflected = 4 * kPi * 0.5;
  for (int bounces = 1; bounces <= 3; ++bounces, reflected = (4 * kPi + reflected) * 0.5) {
    BakeSettings settings = test::coarse_settings(bounces);
    settings.gather.cells_theta = 16;
    settings.gather.cells_phi = 50;
    settings.min_radius = 0.007;
    const BakeResult baked = Stage(scene, settings).bake_everywhere();
    EXPECT_EQ(irradiance_inside(*baked.cache, kDeepLayer).count > 0, bounces > 1);
    // Area-weighted, since records crowd in corners.
    double sum = 0;
    constexpr int kSteps = 24;
    for (int wall = 0; wall < 6; ++wall)
      for (int i = 0; i < kSteps * kSteps; ++i) {
        const int axis = wall / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
        Vec3d p, n(0.0);
        p[axis] = wall % 2;
        n[axis] = wall % 2 ? -1 : 1;
        p[u] = (i % kSteps + 0.5) / kSteps;
        p[v] = (i / kSteps + 0.5) / kSteps;
        sum += baked.cache->irradiance({kTopLayer, p, n, 0.05}).irradiance.g / (kSteps * kSteps);
      }
    EXPECT_NEAR(sum, reflected, 0.02 * reflected) << bounces << " bounces";
  }
}

TEST(Bounces, ManyEndByABoundThatHolds) {
  const double rho = 0.5;
  const Stage stage(furnace(static_cast<float>(rho)), test::coarse_settings(64));
  const BakeResult baked = stage.bake_everywhere();
  EXPECT_LT(baked.deep.orders, 16);
  EXPECT_GT(baked.deep.orders, 5);
  EXPECT_GT(baked.deep.truncation_bound, 0);
  EXPECT_LT(baked.deep.truncation_bound, 1e-3);
  const Range e = irradiance_inside(*baked.cache, kTopLayer);
  const double expected = kPi / (1 - rho);
  EXPECT_GT(e.count, 50u);
  // The bound, and the noise of gathers.
  EXPECT_NEAR(e.mean, expected, (baked.deep.truncation_bound + 0.002) * expected);
  EXPECT_GT(e.mean, 0.98 * expected);
}

TEST(Bounces, SixtyFourCostWhatThreeDo) {
  const auto baked = [](int bounces) {
    return Stage(test::smoky_room(), test::coarse_settings(bounces)).bake_everywhere();
  };
  const BakeResult few = baked(3), many = baked(64);
  EXPECT_LT(double(many.cache->records().size()), 1.1 * double(few.cache->records().size()));
  EXPECT_LT(double(many.stats.counters.gathers), 1.1 * double(few.stats.counters.gathers));
  EXPECT_LT(double(many.stats.counters.cache_queries),
            1.3 * double(few.stats.counters.cache_queries));
}

// Never farther than the nearest surface that its own gather met, however small that is.
TEST(Bounces, DeepRecordsReachNoFartherThanTheGapTheySee) {
  Scene scene = test::smoky_room();
  const double gap = 2e-3;  // Between two boards, far below any radius asked for.
  const auto white = test::add_material(scene, test::diffuse(0.6f));
  test::add_rectangle(scene, {0.1, 0.8, 0.1}, {0, 0, 0.3}, {0.3, 0, 0}, white);
  test::add_rectangle(scene, {0.1, 0.8 + gap, 0.1}, {0, 0, 0.3}, {0.3, 0, 0}, white);
  const Stage stage(scene);
  const BakeResult baked = stage.bake_everywhere();
  const BakeSettings deep = deep_settings(stage.settings);
  const Effects effects = plan_effects(stage.world, deep.bounces, deep.volume_bounces);
  Gatherer gatherer(stage.lighting, effects, deep.gather);
  std::size_t between = 0, checked = 0;
  for (const SurfaceRecord& r : baked.cache->records()) {
    if (r.layer() != kDeepLayer) continue;
    const Vec3d p = Vec3d(r.position[0], r.position[1], r.position[2]) + baked.cache->origin();
    const Vec3d n = Vec3d(r.normal[0], r.normal[1], r.normal[2]).normalized();
    if (++checked % 7 == 0) {
      Counters counters;
      HitLight light;
      const GatherResult g =
          gatherer.gather({p, n, 1e-6, random_key(deep.seed, r.key)}, light, counters);
      EXPECT_LE(r.radius[0], g.nearest * 1.01 + 1e-6);
    }
    const bool is_inside = p.y > 0.79 && p.y < 0.81 && p.x > 0.12 && p.x < 0.38 && p.z > 0.12 &&
                           p.z < 0.38 && (p.y < 0.8 + gap / 2 ? n.y > 0 : n.y < 0);
    if (!is_inside) continue;
    ++between;
    EXPECT_LT(r.radius[0], 1.1 * gap);
  }
  EXPECT_GT(between, 2u);
}

}  // namespace
}  // namespace brume
