// Rays around lamps in a medium: nothing is lost, and no gather is far off.
#include "gather/lamp_rays.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/sampling.h"
#include "gather/gather.h"
#include "support/oracle.h"
#include "support/smoky_rooms.h"

namespace brume {
namespace {

constexpr double kScattering = 0.3;
const Vec3d kLampPlace(0.45, 0.55, 0.5);
const Vec3d kReceiver(0.3, 0.0, 0.35);

Scene hazy_room(const LightDescription& lamp) {
  Scene scene;
  test::add_room(scene, test::kUnitBox, test::add_material(scene, test::diffuse(0.5f)));
  scene.volumes.push_back(test::haze(RgbD(kScattering), RgbD(0.0), 0, test::kUnitBox));
  scene.lights.push_back(lamp);
  return scene;
}

// Irradiance at the receiver of light that scattered once, from points around the lamp and points
// around the receiver, by the balance heuristic: nothing is singular.
double once_scattered(const World& world, int samples) {
  RandomStream random(5);
  const Light& light = *world.lights().front();
  const auto density = [&](const Vec3d& from, const Vec3d& p) {
    const double r = (p - from).length();
    const double end = world.tracer().intersect({from, (p - from) / r}).t;
    return 1 / (4 * kPi * r * r * end);
  };
  const Vec3d receiver = kReceiver + Vec3d(0, 1e-6, 0);
  double sum = 0;
  for (int i = 0; i < samples; ++i)
    for (const Vec3d& from : {kLampPlace, receiver}) {
      const Vec3d w = sample_sphere(random.uniform2());
      const Vec3d p = from + w * (random.uniform() * world.tracer().intersect({from, w}).t);
      const Vec3d way = p - receiver;
      const double t = way.length(), r = (p - kLampPlace).length();
      const double light_here =
          luminance(light.sample(p, {}).weight) * std::exp(-kScattering * (r + t));
      sum += light_here * std::max(0.0, way.y) / (t * t * t) /
             (density(kLampPlace, p) + density(receiver, p));
    }
  return sum / samples * kScattering / (4 * kPi);
}

class LampsInHaze : public testing::TestWithParam<LightDescription> {};

TEST_P(LampsInHaze, MakeNoGatherFarOffAndLoseNoLight) {
  const test::LitWorld lit(hazy_room(GetParam()));
  GatherOptions options;
  options.cells_theta = 8;
  options.cells_phi = 25;
  Gatherer gatherer(lit.lighting, lit.effects, options);
  constexpr int kSeeds = 256;
  std::vector<double> found;
  double mean = 0;
  for (int s = 0; s < kSeeds; ++s) {
    Counters counters;
    const GatherPoint at{kReceiver, Vec3d(0, 1, 0), 1e-6, random_key(7, s)};
    found.push_back(luminance(gatherer.gather(at, {.reflect = false}, counters).irradiance));
    mean += found.back() / kSeeds;
  }
  std::sort(found.begin(), found.end());
  const double truth = once_scattered(lit.world, 200000);
  EXPECT_NEAR(mean / truth, 1, 0.02);
  EXPECT_GT(found.front() / truth, 0.6);
  EXPECT_LT(found.back() / truth, 1.4);
}

INSTANTIATE_TEST_SUITE_P(
    All, LampsInHaze,
    testing::Values(PointLight{kLampPlace, Rgb(1.0f)},
                    SpotLight{kLampPlace, Vec3d(1.0, 0.3, 0.2), Rgb(1.0f), 15, 20},
                    SpotLight{kLampPlace, kReceiver - kLampPlace, Rgb(1.0f), 25, 30}));

TEST(LampRays, ShareCellsByTheBalanceHeuristic) {
  const Scene scene = hazy_room(PointLight{kLampPlace, Rgb(1.0f)});
  const World world(scene);
  const DirectionCells cells(200);
  LampRays rays(world, plan_effects(world, 1, 1));
  // The integral of cos^2 over the hemisphere, 2 pi / 3, by cells' rays and lamps' together.
  double sum = 0;
  constexpr int kSeeds = 400;
  for (int s = 0; s < kSeeds; ++s) {
    RandomStream random(random_key(9, s));
    const Frame frame = Frame(Vec3d(0, 1, 0)).turned(2 * kPi * random.uniform());
    rays.draw(kReceiver, frame, cells, random);
    const Vec2d shift = random.uniform2();
    for (int c = 0; c < cells.count(); ++c) {
      const Vec3d w = frame.to_world(cells.direction(c, shift));
      sum += cells.cell(c).measure * w.y * rays.share(cells, c, w, w.y);
    }
    EXPECT_EQ(rays.rays().size(), 16u);
    for (const LampRay& r : rays.rays())
      sum += cells.cell(r.cell).measure * r.direction.y * r.share;
  }
  EXPECT_NEAR(sum / kSeeds / (2 * kPi / 3), 1, 1e-3);
}

TEST(LampRays, AreDrawnWhereTheMediumScattersAlone) {
  Scene scene = hazy_room(PointLight{kLampPlace, Rgb(1.0f)});
  scene.volumes.clear();
  const World world(scene);
  const DirectionCells cells(200);
  LampRays rays(world, plan_effects(world, 1, 1));
  rays.draw(kReceiver, Frame(Vec3d(0, 1, 0)), cells, RandomStream(1));
  EXPECT_TRUE(rays.rays().empty());
}

}  // namespace
}  // namespace brume
