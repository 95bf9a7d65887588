// Layers of records against the geometric series of a closed diffuse box: every wall glows with
// radiance 1, seen by gathers only, and reflects rho, so after l reflections E = pi (1 - rho^(l+1))
// / (1 - rho).
#include <gtest/gtest.h>

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

TEST(Bounces, LayersFollowTheGeometricSeries) {
  const double rho = 0.6;
  for (const int bounces : {1, 2, 3, 4}) {
    const Stage stage(furnace(static_cast<float>(rho)), test::coarse_settings(bounces));
    const BakeResult baked = stage.bake_everywhere();
    EXPECT_EQ(baked.layers, bounces + 1);
    EXPECT_EQ(baked.truncation_bound, 0);
    for (int layer = 0; layer <= bounces; ++layer) {
      const Range e = irradiance_inside(*baked.cache, layer);
      const double expected = series(rho, layer);
      EXPECT_GT(e.count, 50u);
      EXPECT_NEAR(e.mean, expected, 0.003 * expected) << "layer " << layer << " of " << bounces;
      EXPECT_GT(e.least, 0.99 * expected) << "layer " << layer << " of " << bounces;
      EXPECT_LT(e.most, 1.01 * expected) << "layer " << layer << " of " << bounces;
    }
  }
}

// Without a glow the deepest layer is missing: E_1 is the reflection of direct light.
TEST(Bounces, DirectLightReflectsOnceInTheFirstLayer) {
  Scene scene;
  test::add_room(scene, test::kUnitBox, test::add_material(scene, test::diffuse(0.5f)));
  scene.lights.emplace_back(PointLight{{0.5, 0.5, 0.5}, Rgb(1.0f)});
  BakeSettings settings = test::coarse_settings(3);
  settings.gather.cells_theta = 16;
  settings.gather.cells_phi = 50;
  settings.min_radius = 0.004;
  const Stage stage(scene, settings);
  const BakeResult baked = stage.bake_everywhere();
  EXPECT_EQ(baked.layers, 3);
  EXPECT_EQ(irradiance_inside(*baked.cache, 0).count, 0u);
  // All of 4 pi W fall on the walls, half of what falls is reflected, and nothing leaves.
  double reflected = 4 * kPi * 0.5;
  for (int layer = 1; layer <= 3; ++layer, reflected = (4 * kPi + reflected) * 0.5) {
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
        sum += baked.cache->irradiance({layer, p, n, 0.05}).irradiance.g / (kSteps * kSteps);
      }
    EXPECT_NEAR(sum, reflected, 0.02 * reflected) << "layer " << layer;
  }
}

TEST(Bounces, ManyAreFewLayersAndABound) {
  const double rho = 0.5;
  const Stage stage(furnace(static_cast<float>(rho)), test::coarse_settings(64));
  const BakeResult baked = stage.bake_everywhere();
  EXPECT_LT(baked.layers, 16);
  EXPECT_GT(baked.layers, 5);
  EXPECT_GT(baked.truncation_bound, 0);
  EXPECT_LT(baked.truncation_bound, 0.01);
  const Range e = irradiance_inside(*baked.cache, 64);
  const double expected = kPi / (1 - rho);
  EXPECT_GT(e.count, 50u);
  // The bound, and the noise of gathers.
  EXPECT_NEAR(e.mean, expected, (baked.truncation_bound + 0.002) * expected);
  EXPECT_GT(e.mean, 0.98 * expected);
}

}  // namespace
}  // namespace brume
