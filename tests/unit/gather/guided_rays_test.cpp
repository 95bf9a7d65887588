// Rays around lamps in a medium: nothing is lost, and no gather is far off.
#include "gather/guided_rays.h"

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

// A room whose lamp shines down, and up on the ceiling a hand's breadth above it.
Scene room_with_a_slit(double gap = 0.02) {
  Scene scene;
  test::add_room(scene, {Vec3d(0.0), Vec3d(5.5, 3, 5.5)},
                 test::add_material(scene, test::diffuse(0.7f)));
  Material glowing = test::diffuse(0);
  glowing.emission = Rgb(20.0f);
  glowing.two_sided = true;
  test::add_rectangle(scene, {2.1, 3 - gap, 2.2}, {1.3, 0, 0}, {0, 0, 1.1},
                      test::add_material(scene, glowing));
  return scene;
}

void expect_shares_add_up(const Scene& scene, const Vec3d& receiver, const Vec3d& normal) {
  const World world(scene);
  const BrightPatches patches(world);
  const DirectionCells cells(200);
  GuidedRays rays(world, plan_effects(world, 1, 1), patches);
  // The integral of cos^2 over the hemisphere, 2 pi / 3, by cells' rays and guided ones together.
  double sum = 0, guided = 0;
  constexpr int kSeeds = 400;
  for (int s = 0; s < kSeeds; ++s) {
    Counters counters;
    RandomStream random(random_key(9, s));
    const Frame frame = Frame(normal).turned(2 * kPi * random.uniform());
    rays.draw(receiver, frame, cells, true, random, counters);
    const Vec2d shift = random.uniform2();
    for (int c = 0; c < cells.count(); ++c) {
      const Vec3d w = frame.to_world(cells.direction(c, shift));
      const double cosine = w.dot(normal);
      sum += cells.cell(c).measure * cosine * rays.share(cells, c, w, cosine);
    }
    guided += double(rays.rays().size()) / kSeeds;
    for (const GuidedRay& r : rays.rays())
      sum += cells.cell(r.cell).measure * r.direction.dot(normal) * r.share;
  }
  EXPECT_GE(guided, 15.99);
  EXPECT_NEAR(sum / kSeeds / (2 * kPi / 3), 1, 1e-3);
}

TEST(GuidedRays, ShareCellsByTheBalanceHeuristic) {
  expect_shares_add_up(hazy_room(PointLight{kLampPlace, Rgb(1.0f)}), kReceiver, {0, 1, 0});
  expect_shares_add_up(room_with_a_slit(), {2.8, 2.9, 5.4}, {0, 0, -1});
}

TEST(GuidedRays, AreNoneWhereNothingIsNearALamp) {
  Scene scene = hazy_room(PointLight{kLampPlace, Rgb(1.0f)});
  scene.volumes.clear();
  const World world(scene);
  const BrightPatches patches(world);
  const DirectionCells cells(200);
  GuidedRays rays(world, plan_effects(world, 1, 1), patches);
  Counters counters;
  rays.draw(kReceiver, Frame(Vec3d(0, 1, 0)), cells, true, RandomStream(1), counters);
  EXPECT_TRUE(rays.rays().empty());
}

// Irradiance of light that surfaces reflected once, by so many cosine-distributed rays.
double once_reflected(const World& world, const Vec3d& p, const Vec3d& n, int samples) {
  RandomStream random(9);
  const Light& light = *world.lights().front();
  double sum = 0;
  for (int i = 0; i < samples; ++i) {
    const Vec3d w = Frame(n).to_world(sample_cosine_hemisphere(random.uniform2()));
    const Hit hit = world.tracer().intersect({p, w});
    const Vec2d u = random.uniform2();
    if (!hit.is_hit() || !world.material(hit).reflects()) continue;
    const Vec3d facing = hit.normal.dot(w) < 0 ? hit.normal : -hit.normal;
    const Vec3d q = hit.position + facing * hit.offset;
    const LightSample s = light.sample(q, u);
    const double cosine = facing.dot(s.direction);
    if (!(cosine > 0) || is_black(s.weight) || world.tracer().is_occluded(shadow_ray(q, s)))
      continue;
    sum += luminance(s.weight) * cosine * world.material(hit).albedo.g;
  }
  return sum / samples;
}

// Without rays towards what the lamp lights above itself, gathers near the ceiling are up to 60 %
// off.
TEST(GuidedRays, FindLightThatLeavesANarrowSlit) {
  const test::LitWorld lit(room_with_a_slit());
  Gatherer gatherer(lit.lighting, lit.effects, {});
  for (const double y : {2.9, 2.5}) {
    const Vec3d p(2.8, y, 5.5), n(0, 0, -1);
    const double truth = once_reflected(lit.world, p + n * 1e-5, n, 2'000'000);
    constexpr int kSeeds = 128;
    double mean = 0, squares = 0, estimated = 0;
    for (int s = 0; s < kSeeds; ++s) {
      Counters counters;
      const GatherResult g = gatherer.gather({p, n, 1e-5, random_key(11, s)}, HitLight(), counters);
      const double off = luminance(g.irradiance) / truth - 1;
      mean += off / kSeeds;
      squares += off * off / kSeeds;
      estimated += g.error * g.error / (truth * truth * kSeeds);
    }
    EXPECT_NEAR(mean, 0, 0.015) << y;
    EXPECT_LT(std::sqrt(squares), 0.045) << y;
    EXPECT_NEAR(std::sqrt(squares / estimated), 1, 0.35) << y;
  }
}

// Past two edges of a lamp 4 mm below the ceiling: strips that few places tried lie in.
TEST(GuidedRays, FitStripsPastEdges) {
  const test::LitWorld lit(room_with_a_slit(0.004));
  Gatherer gatherer(lit.lighting, lit.effects, {});
  const Vec3d p(1.2, 2.2, 5.5), n(0, 0, -1);
  const double truth = once_reflected(lit.world, p + n * 1e-5, n, 4'000'000);
  constexpr int kSeeds = 256;
  double mean = 0, squares = 0;
  for (int s = 0; s < kSeeds; ++s) {
    Counters counters;
    const GatherResult g = gatherer.gather({p, n, 1e-5, random_key(15, s)}, HitLight(), counters);
    const double off = luminance(g.irradiance) / truth - 1;
    mean += off / kSeeds;
    squares += off * off / kSeeds;
  }
  EXPECT_NEAR(mean, 0, 0.015);
  EXPECT_LT(std::sqrt(squares), 0.022) << "0.029 by coarse patches alone";
}

// Against differences of the mean of many gathers, which know no gradients. By cells alone, whose
// walls lie nearer or farther than the slit, what goes up is twice as steep.
TEST(GuidedRays, KeepGradientsRight) {
  const test::LitWorld lit(room_with_a_slit());
  Gatherer gatherer(lit.lighting, lit.effects, {});
  const Vec3d n(0, 0, -1);
  for (const Vec3d& p : {Vec3d(2.8, 2.6, 5.5), Vec3d(1.2, 2.75, 5.5)}) {
    constexpr int kSeeds = 600;
    constexpr double kStep = 0.1;
    const auto mean_of = [&](const Vec3d& at, Vec3d* gradient) {
      double mean = 0;
      for (int s = 0; s < kSeeds; ++s) {
        Counters counters;
        const GatherResult g =
            gatherer.gather({at, n, 1e-5, random_key(13, s)}, HitLight(), counters);
        mean += luminance(g.irradiance) / kSeeds;
        if (gradient) *gradient += luminance(g.terms.sum()) / kSeeds;
      }
      return mean;
    };
    Vec3d found(0.0);
    mean_of(p, &found);
    for (int a = 0; a < 2; ++a) {
      Vec3d step(0.0);
      step[a] = kStep;
      const double truth = (mean_of(p + step, nullptr) - mean_of(p - step, nullptr)) / (2 * kStep);
      EXPECT_NEAR(found[a], truth, 0.005 + 0.12 * std::abs(truth)) << p << ", axis " << a;
    }
  }
}

TEST(BrightPatches, LieWhereALampIsNear) {
  const World world(room_with_a_slit());
  const BrightPatches patches(world);
  ASSERT_FALSE(patches.empty());
  Counters counters;
  std::vector<BrightPatch> seen;
  patches.visible_from({2.8, 2.7, 5.4}, {0, 0, -1}, 0.01, 256, RandomStream(1), counters, seen);
  ASSERT_FALSE(seen.empty());
  const BrightPatch& first = seen.front();
  EXPECT_NEAR(first.centre.y, 3, 1e-4);
  EXPECT_NEAR(first.centre.z, 3.3, 0.4) << "behind the edge that faces the receiver";
  EXPECT_LT(first.normal.y, -0.99);
  EXPECT_NEAR(first.u.dot(first.v), 0, 1e-9);
  // Not from below the lamp, nor behind the receiver's own surface.
  patches.visible_from({2.75, 2.9, 2.75}, {0, 1, 0}, 0.01, 256, RandomStream(2), counters, seen);
  EXPECT_TRUE(seen.empty());
  patches.visible_from({2.8, 2.7, 5.4}, {0, 0, 1}, 0.01, 256, RandomStream(3), counters, seen);
  EXPECT_TRUE(seen.empty());
}

// From a corner two edges of the lamp show what lies above: strips a tenth and less of what lies
// between the places found.
TEST(BrightPatches, FitWhatIsSeenPastEdges) {
  const World world(room_with_a_slit());
  const BrightPatches patches(world);
  const DirectionCells cells(1280);
  GuidedRays rays(world, plan_effects(world, 1, 1), patches);
  for (const Vec3d& receiver : {Vec3d(2.8, 2.4, 5.4), Vec3d(1.0, 2.5, 5.4)}) {
    int drawn = 0, bright = 0;
    for (int s = 0; s < 20; ++s) {
      Counters counters;
      rays.draw(receiver, Frame(Vec3d(0, 0, -1)), cells, true, RandomStream(random_key(14, s)),
                counters);
      for (const GuidedRay& ray : rays.rays()) {
        const Vec3d at = world.tracer().intersect({receiver, ray.direction}).position;
        const bool is_above_lamp =
            at.y > 2.999 && at.x > 2.08 && at.x < 3.42 && at.z > 2.18 && at.z < 3.32;
        drawn += 1;
        bright += is_above_lamp;
      }
    }
    EXPECT_GT(bright, 0.3 * drawn) << receiver << ": " << bright << " of " << drawn;
  }
}

TEST(BrightPatches, AreNoneInAnEvenlyLitRoomOrUnderASky) {
  Scene room;
  test::add_room(room, test::kUnitBox, test::add_material(room, test::diffuse(0.5f)));
  room.lights.emplace_back(PointLight{Vec3d(0.5), Rgb(1.0f)});
  const auto has_patches = [&] {
    const World world(room);
    return !BrightPatches(world).empty();
  };
  EXPECT_FALSE(has_patches());
  room.lights = {EnvironmentLight{}};
  EXPECT_FALSE(has_patches());
  room.lights.clear();
  EXPECT_FALSE(has_patches());
}

}  // namespace
}  // namespace brume
