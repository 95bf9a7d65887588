// Hard cases of gathers: finite differences, tiny distances, media nobody can see through, lights
// on the spot (gradients.md 7, HARD_CASES N05 to N32).
#include <gtest/gtest.h>

#include "bake/bake.h"
#include "core/random.h"
#include "gather/medium_source.h"
#include "support/oracle.h"
#include "support/scene_builder.h"

namespace brume {
namespace {

GatherOptions cells(int theta, int phi) {
  GatherOptions o;
  o.cells_theta = theta;
  o.cells_phi = phi;
  return o;
}

bool is_sound(const GatherResult& r) {
  const RgbGradient g = r.terms.sum();
  return is_finite(r.irradiance) && r.irradiance.g >= 0 && is_finite(g.r) && is_finite(g.g) &&
         is_finite(g.b) && is_finite(r.rotational.g) && std::isfinite(r.error);
}

GatherResult gather_once(const Scene& scene, const Vec3d& at, const Vec3d& normal,
                         std::uint64_t key = 3) {
  const test::LitWorld lit(scene);
  Counters counters;
  return Gatherer(lit.lighting, lit.effects, cells(16, 50))
      .gather({at, normal, 0, key}, HitLight{.reflect = false}, counters);
}

// HARD_CASES N21: the mean gradient against central differences of the same samples, over seeds.
class FiniteDifferences : public testing::TestWithParam<const char*> {};

TEST_P(FiniteDifferences, AgreeWithTheGradient) {
  const test::LitWorld lit(make_scene(oracle_scene(GetParam(), 0.1)));
  GatherOptions options = cells(48, 151);
  options.lamp_samples = 0;  // Drawn ones would drown differences in noise.
  Gatherer gatherer(lit.lighting, lit.effects, options);
  const Vec3d at = std::string(GetParam()) == "vac" ? Vec3d(0.35, 0.2, 0) : Vec3d(-1, 0.25, 0);
  constexpr int kSeeds = 12;
  constexpr double kStep = 0.02;
  Vec3d gradient(0.0), difference(0.0), squares(0.0);
  for (int s = 0; s < kSeeds; ++s) {
    Counters counters;
    const auto gather = [&](const Vec3d& p) {
      return gatherer.gather({p, {0, 0, 1}, 0, random_key(29, s)}, HitLight{.reflect = false},
                             counters);
    };
    const Vec3d g = gather(at).terms.sum().g;
    Vec3d d(0.0);
    for (int a = 0; a < 2; ++a) {
      Vec3d h(0.0);
      h[a] = kStep;
      d[a] = (gather(at + h).irradiance.g - gather(at - h).irradiance.g) / (2 * kStep);
      squares[a] += (d[a] - g[a]) * (d[a] - g[a]) / kSeeds;
    }
    gradient += g / kSeeds;
    difference += d / kSeeds;
  }
  const double slope = std::hypot(difference.x, difference.y);
  for (int a = 0; a < 2; ++a) {
    const double noise = std::sqrt(squares[a] / kSeeds);
    EXPECT_NEAR(gradient[a], difference[a], std::max(0.05 * slope, 3 * noise)) << "axis " << a;
    // What the check can see: the noise must not drown the gradient.
    EXPECT_LT(noise, 0.15 * slope);
  }
}

INSTANTIATE_TEST_SUITE_P(OfEveryKind, FiniteDifferences,
                         testing::Values("vac", "abs", "absg", "emi", "scatopen", "scathg", "scatg",
                                         "emiplate", "scatcard"));

// Gradients of other modes are those of the last gather's samples, however often they are asked for.
TEST(Gather, OtherModesAreOfTheSameSamples) {
  const test::LitWorld lit(make_scene(oracle_scene("scatg", 0.1)));
  GatherOptions options = cells(16, 50);
  Gatherer gatherer(lit.lighting, lit.effects, options);
  Counters counters;
  gatherer.gather({{-1, 0.25, 0}, {0, 0, 1}, 0, 7}, HitLight{.reflect = false}, counters);
  const Vec3d first = gatherer.gradient(GradientMode::Media).sum().g;
  EXPECT_GT(first.length(), 0);
  EXPECT_EQ(gatherer.gradient(GradientMode::Media).sum().g, first);
}

// gradients.md 3, T4: a glossy reflector sends another radiance to where the receiver moves.
TEST(Gather, GlossyReflectorsLobesFollowTheReceiver) {
  Scene scene;
  Material glossy = test::diffuse(0);
  glossy.specular = Rgb(0.6f);
  glossy.roughness = 0.5f;
  const auto shiny = test::add_material(scene, glossy);
  test::add_rectangle(scene, {1, -3, 0.02}, {0, 0, 3}, {0, 6, 0}, shiny);  // Faces -x.
  scene.lights.emplace_back(PointLight{{-0.5, -0.8, 1.5}, Rgb(10.0f)});
  const World world(scene);
  const Lighting lighting(world, {});
  Gatherer gatherer(lighting, plan_effects(world, 1, 1), cells(64, 201));
  constexpr int kSeeds = 8;
  constexpr double kStep = 0.01;
  Vec3d gradient(0.0), difference(0.0), directional(0.0);
  for (int s = 0; s < kSeeds; ++s) {
    Counters counters;
    const auto gather = [&](const Vec3d& p) {
      return gatherer.gather({p, {0, 0, 1}, 0, random_key(31, s)}, HitLight{}, counters);
    };
    const Vec3d at(0, 0.3, 0);
    const GatherResult here = gather(at);
    gradient += here.terms.sum().g / kSeeds;
    directional += here.terms.directional.g / kSeeds;
    for (int a = 0; a < 3; ++a) {
      Vec3d h(0.0);
      h[a] = kStep;
      difference[a] +=
          (gather(at + h).irradiance.g - gather(at - h).irradiance.g) / (2 * kStep) / kSeeds;
    }
  }
  const double slope = difference.length();
  EXPECT_GT(slope, 0);
  EXPECT_NEAR((gradient - difference).length(), 0, 0.05 * slope);
  EXPECT_GT(directional.length(), 0.2 * slope);  // Without it the gradient would be wrong.
}

// HARD_CASES N20: closer to a wall than a ten-thousandth of the scene, and in a crack.
TEST(Gather, TinyDistancesKeepRecordsBounded) {
  Scene scene = make_scene(oracle_scene("scat"));
  const auto glow = test::add_material(scene, test::gathered_emitter(1));
  test::add_rectangle(scene, {-1.5, -1, 0}, {0, 0, 1}, {0, 2, 0}, glow);     // Faces -x.
  test::add_rectangle(scene, {-1.5004, 1, 0}, {0, 0, 1}, {0, -2, 0}, glow);  // Faces it.
  const test::LitWorld lit(scene);
  BakeSettings settings;
  Gatherer gatherer(lit.lighting, lit.effects, cells(16, 50));
  for (const double x : {-1.5 - 1e-7, -1.5001, -1.5002, -1.50039, -1.501, -1.4999}) {
    for (int s = 0; s < 8; ++s) {
      Counters counters;
      const GatherResult r = gatherer.gather({{x, 0.1, 0}, {0, 0, 1}, 0, random_key(s)},
                                             HitLight{.reflect = false}, counters);
      ASSERT_TRUE(is_sound(r)) << x;
      // All a point can get is pi times the brightest radiance: 1, and a little from the lamp.
      EXPECT_LE(r.irradiance.g, 1.1 * kPi);
      const double clearance = lit.world.tracer().clearance({x, 0.1, 0}, {0, 0, 1});
      const double radius = record_radius(r, {0, 0, 1}, clearance, settings, 1);
      EXPECT_GT(radius, 0);
      EXPECT_LE(radius, r.nearest);
      const Vec3d g = r.terms.sum().g;
      const double slope = std::hypot(g.x, g.y);
      EXPECT_LE(slope * radius, 1.001 * settings.error * r.irradiance.g);
    }
  }
}

// gradients.md 7.2: light that is lost on the way leaves 0, not 0/0, whatever it was.
TEST(Gather, NothingIsSeenThroughTheDensestMedium) {
  for (const double sigma : {1e3, 1e6, 1e12, 1e30}) {
    Scene scene = make_scene(oracle_scene("abs"));
    scene.materials.back().emission = Rgb(1e30f);
    scene.volumes[0].sigma_a = RgbD(sigma);
    const GatherResult r = gather_once(scene, {-0.6, 0.25, 0}, {0, 0, 1});
    EXPECT_EQ(r.irradiance.g, 0) << sigma;
    EXPECT_EQ(r.terms.sum().g, Vec3d(0.0)) << sigma;
  }
}

TEST(Gather, NothingIsLostInTheThinnestMedium) {
  Scene clear = make_scene(oracle_scene("vacblk"));
  const GatherResult without = gather_once(clear, {-0.6, 0.25, 0}, {0, 0, 1});
  for (const double sigma : {1e-30, 1e-300, 1e-12}) {
    Scene scene = make_scene(oracle_scene("abs"));
    scene.volumes[0].sigma_a = RgbD(sigma);
    const GatherResult r = gather_once(scene, {-0.6, 0.25, 0}, {0, 0, 1});
    EXPECT_NEAR(r.irradiance.g, without.irradiance.g, 1e-9 * without.irradiance.g);
    EXPECT_NEAR((r.terms.sum().g - without.terms.sum().g).length(), 0,
                1e-9 * without.terms.sum().g.length());
  }
}

// Densest and thinnest where light scatters: finite, never negative, and never more than the
// light's own.
TEST(Gather, ScatteringStaysFiniteAtAnyDensity) {
  for (const double sigma : {1e-30, 1e-6, 1.0, 1e3, 1e6, 1e30}) {
    Scene scene = make_scene(oracle_scene("scathg"));
    scene.volumes[0].sigma_s = RgbD(sigma);
    scene.volumes[0].sigma_a = RgbD(0.0);
    for (int s = 0; s < 4; ++s)
      EXPECT_TRUE(is_sound(gather_once(scene, {-1, 0.25, 0}, {0, 0, 1}, s))) << sigma;
  }
}

// gradients.md 7.5: a ray that passes a light at a thousandth. Marched with equi-angular samples
// the integral of 1/d^2 along it is (atan((4 - 1.7)/h) + atan(1.7/h)) / h.
TEST(MediumSource, LightBesideTheRayIsIntegratedWithoutNoise) {
  constexpr double kHeight = 1e-3, kThin = 1e-9;
  Scene scene;
  scene.lights.emplace_back(PointLight{{kHeight, 0, 1.7}, Rgb(1.0f)});
  Volume v;
  v.sigma_s = RgbD(kThin);
  scene.volumes.push_back(v);
  const auto black = test::add_material(scene, test::diffuse(0));
  test::add_rectangle(scene, {-9, -9, -9}, {18, 0, 0}, {0, 18, 0}, black);
  const test::LitWorld lit(scene);
  std::vector<double> boundaries, jitter;
  for (int i = 0; i <= 64; ++i) boundaries.push_back(4.0 * i / 64);
  ShellMarcher marcher(lit.world.medium(), {});
  MediumSource source(lit.lighting, lit.effects);
  for (const double u : {0.01, 0.5, 0.77}) {
    jitter.assign(64, u);
    const std::vector<float> shifts(64, static_cast<float>(u));
    const Ray ray{{0, 0, 0}, {0, 0, 1}};
    MarchCounters march;
    marcher.march(ray, boundaries, kInfinity, jitter, false, march);
    Counters counters;
    RandomStream random(5);
    double sum = 0;
    source.begin();
    const int added = source.add(marcher.view(), ray, boundaries, kInfinity, {shifts}, random);
    source.finish(counters);
    for (const MediumLight& part : source.light(added))
      sum += part.light.g;
    EXPECT_NEAR(sum * 4 * kPi / kThin, 3140.569636, 1e-3 * 3140.569636) << u;
  }
}

// HARD_CASES N18, N19: a light a thousandth of a cell from the axis of the zenith, on the
// receiver's very place, on a wall.
TEST(Gather, LightsAnywhereKeepTheGatherFinite) {
  for (const Vec3d& at : {Vec3d(-1 + 1e-6, 0.25, 0.8), Vec3d(-1, 0.25, 0), Vec3d(-1, 0.25, 1e-9),
                          Vec3d(-2, 0.25, 0.5), Vec3d(-2, -2, 2.5)}) {
    Scene scene = make_scene(oracle_scene("scathg"));
    std::get<PointLight>(scene.lights[0]).position = at;
    for (int s = 0; s < 8; ++s)
      EXPECT_TRUE(is_sound(gather_once(scene, {-1, 0.25, 0}, {0, 0, 1}, s)));
  }
}

// HARD_CASES N05: the same room in other units, geometry and coefficients with them: the irradiance
// stays, the gradient is per scene unit.
TEST(Gather, UnitsChangeNothingButTheScale) {
  const OracleScene oracle = oracle_scene("scat");
  const Scene metres = make_scene(oracle);
  constexpr double kScale = 0x1p7;
  Scene small = metres;  // A unit of 1/128 m.
  small.unit = 1 / kScale;
  for (TriangleMesh& mesh : small.meshes)
    for (Vec3d& p : mesh.positions) p *= kScale;
  std::get<PointLight>(small.lights[0]).position *= kScale;
  small.volumes[0].sigma_s *= 1 / kScale;
  small.volumes[0].sigma_a *= 1 / kScale;
  const Vec3d at(-1, 0.25, 0);
  const GatherResult a = gather_once(metres, at, {0, 0, 1});
  const GatherResult b = gather_once(small, at * kScale, {0, 0, 1});
  EXPECT_NEAR(b.irradiance.g, a.irradiance.g, 1e-5 * a.irradiance.g);
  EXPECT_NEAR((b.terms.sum().g * kScale - a.terms.sum().g).length(), 0,
              1e-5 * a.terms.sum().g.length());
}

// HARD_CASES N32: without extinction the full gradient is Ward and Heckbert's.
TEST(Gather, ClearVolumesAreVacuum) {
  Scene scene = make_scene(oracle_scene("vacblk"));
  Volume clear;
  clear.bounds = {Vec3d(-2), Vec3d(2)};
  scene.volumes.push_back(clear);
  const test::LitWorld lit(scene);
  Gatherer gatherer(lit.lighting, lit.effects, cells(16, 50));
  Counters counters;
  const Vec3d full =
      gatherer.gather({{-0.6, 0.25, 0}, {0, 0, 1}, 0, 3}, HitLight{.reflect = false}, counters)
          .terms.sum()
          .g;
  const Vec3d ward = gatherer.gradient(GradientMode::WardHeckbert).sum().g;
  EXPECT_NEAR((full - ward).length(), 0, 1e-5 * ward.length());
  EXPECT_EQ(counters.segments, 0u);
}

}  // namespace
}  // namespace brume
