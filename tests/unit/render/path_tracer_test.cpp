#include "render/path_tracer.h"

#include <gtest/gtest.h>

#include <array>

#include "core/random.h"
#include "plan/effects.h"
#include "support/dense_grid.h"
#include "support/sensor.h"

namespace brume {
namespace {

using test::expect_near;
using test::Measured;
using test::options_of;
using test::Sensor;

TriangleMesh plane(double half, double z, std::uint32_t material) {
  TriangleMesh mesh;
  mesh.positions = {{-half, -half, z}, {half, -half, z}, {half, half, z}, {-half, half, z}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.materials = {material, material};
  return mesh;
}

// Faces look in.
TriangleMesh room(double half, std::uint32_t material) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.positions.push_back({i & 1 ? half : -half, i & 2 ? half : -half, i & 4 ? half : -half});
  mesh.triangles = {{0, 1, 2}, {1, 3, 2}, {4, 6, 5}, {5, 6, 7}, {0, 4, 1}, {1, 4, 5},
                    {2, 3, 6}, {3, 7, 6}, {0, 2, 4}, {2, 6, 4}, {1, 5, 3}, {3, 5, 7}};
  mesh.materials.assign(12, material);
  return mesh;
}

Material diffuse(double albedo) {
  Material m;
  m.albedo = Rgb(float(albedo));
  return m;
}

Material lamp(double radiance, bool direct) {
  Material m;
  m.albedo = Rgb(0.0f);
  m.emission = Rgb(float(radiance));
  m.direct = direct;
  return m;
}

Volume homogeneous(const RgbD& sigma_s, const RgbD& sigma_a, double g = 0,
                   const Box3d& bounds = Box3d(Vec3d(-kInfinity), Vec3d(kInfinity))) {
  Volume v;
  v.sigma_s = sigma_s;
  v.sigma_a = sigma_a;
  v.phase = HenyeyGreenstein(g);
  v.bounds = bounds;
  return v;
}

Volume lumpy(const Box3d& box, const RgbD& sigma_s, const RgbD& sigma_a, double g) {
  Volume v = homogeneous(sigma_s, sigma_a, g);
  v.density = test::dense_grid(box, 41, [&](const Vec3d& p) {
    const Vec3d q = (p - (box.min + box.max) * 0.5) / (box.max.x - box.min.x);
    const double edge = std::max({std::abs(q.x), std::abs(q.y), std::abs(q.z)});
    return edge > 0.45 ? 0.0 : 1 + std::sin(9 * q.x) * std::sin(11 * q.y + 1) * std::sin(7 * q.z);
  });
  return v;
}

// oracle_cases.md A1.
TEST(PathTracer, QuadLightsAPlaneByLambertsFormula) {
  Scene scene;
  scene.materials = {diffuse(0.5)};
  scene.meshes = {plane(10, 0, 0)};
  scene.lights = {QuadLight{{-0.5, -0.4, 1}, {0, 0.9, 0}, {1.1, 0, 0}, Rgb(4.0f)}};
  const World world(scene);
  Sensor sensor({0.6, 0.3, 0.5}, {0.35, 0.20, 0});
  for (const Transport transport : {Transport::Cached, Transport::Full}) {
    sensor.expose(world, options_of(transport, 64));
    expect_near(sensor.layer(Layer::DiffuseDirect), RgbD(0.5 / kPi * 2.632746958), 1e-6, 0.003);
    expect_near(sensor.beauty(), RgbD(0.5 / kPi * 2.632746958), 1e-6, 0.003);
  }
}

// oracle_cases.md A3: E = 2 pi E_3(0.8), seen through a little of the absorber.
TEST(PathTracer, GathersAPlaneThroughAnAbsorber) {
  Scene scene;
  scene.materials = {diffuse(0.5), lamp(1, false)};
  TriangleMesh ceiling = plane(500, 1, 1);
  for (auto& t : ceiling.triangles) std::swap(t[1], t[2]);
  scene.meshes = {plane(500, 0, 0), ceiling};
  scene.volumes = {homogeneous(RgbD(0.0), RgbD(0.8))};
  const World world(scene);
  Sensor sensor({0, 0, 0.5}, {0, 0, 0});
  sensor.expose(world, options_of(Transport::Cached, 256));
  const double eye = std::exp(-0.8 * 0.5);
  expect_near(sensor.of([](const PixelResult& p) { return p.transmittance; }), RgbD(eye));
  expect_near(sensor.layer(Layer::DiffuseIndirect), RgbD(eye * 0.5 / kPi * 0.906813189352), 1e-5);
}

// oracle_cases.md A4.
TEST(PathTracer, GathersAnEmissiveSlab) {
  Scene scene;
  scene.materials = {diffuse(1)};
  scene.meshes = {plane(500, 0, 0)};
  Volume slab = homogeneous(RgbD(0.0), RgbD(0.5), 0, Box3d({-500, -500, -1}, {500, 500, 2}));
  slab.emission.mode = Emission::Mode::Density;
  scene.volumes = {slab};
  const World world(scene);
  Sensor sensor({0, 0, 1}, {0, 0, 0});
  sensor.expose(world, options_of(Transport::Cached, 256));
  const double eye = std::exp(-0.5);
  expect_near(sensor.layer(Layer::DiffuseIndirect), RgbD(eye / kPi * 2.452377696977), 1e-5);
  expect_near(sensor.layer(Layer::VolumeEmission), RgbD(1 - eye), 1e-5);
}

struct PointLightCase {
  double closest, g;
};
class SingleScattering : public testing::TestWithParam<PointLightCase> {};

// A point light beside the eye ray in an endless medium, against a fine midpoint rule.
TEST_P(SingleScattering, OfAPointLightMatchesQuadrature) {
  const auto [closest, g] = GetParam();
  const double sigma_s = 0.3, sigma_a = 0.1, sigma_t = sigma_s + sigma_a, unit = 0.5;
  const Vec3d light(0, closest, 2), eye(0, 0, 0), end(0, 0, 5);
  Scene scene;
  scene.unit = unit;
  scene.materials = {diffuse(0)};
  scene.meshes = {plane(20, 5, 0)};
  scene.lights = {PointLight{light, Rgb(3.0f)}};
  scene.volumes = {homogeneous(RgbD(sigma_s), RgbD(sigma_a), g)};
  const World world(scene);
  Sensor sensor(eye, end);
  for (const Transport transport : {Transport::Cached, Transport::Full}) {
    sensor.expose(world, options_of(transport, 256));
    const HenyeyGreenstein phase(g);
    double expected = 0;
    constexpr int kSteps = 400'000;
    for (int i = 0; i < kSteps; ++i) {
      const double t = 5 * (i + 0.5) / kSteps;
      const Vec3d p(0, 0, t), to = light - p;
      const double d = to.length();
      expected += 5.0 / kSteps * std::exp(-sigma_t * (t + d)) * sigma_s * 3 /
                  (d * unit * d * unit) * phase.eval(-to / d, Vec3d(0, 0, -1));
    }
    expect_near(sensor.layer(Layer::VolumeDirect), RgbD(expected), 1e-4, 0.01);
  }
}
INSTANTIATE_TEST_SUITE_P(NearAndFar, SingleScattering,
                         testing::Values(PointLightCase{1, 0}, PointLightCase{0.05, 0},
                                         PointLightCase{1e-3, 0}, PointLightCase{0.5, 0.6},
                                         PointLightCase{0.5, -0.8}));

// Extinction differs between channels, a ramp and a box overlap, and one endless haze fills the
// rest.
TEST(PathTracer, ChromaticTransmittanceOfOverlappingMediaIsUnbiased) {
  const Box3d box({-1, -1, -1}, {1, 1, 1});
  Volume ramp = homogeneous({0.2, 0.1, 0.0}, {0.3, 0.6, 1.1});
  ramp.density = test::dense_grid(box, 17, [](const Vec3d& p) { return 1.5 + p.z; });
  Scene scene;
  scene.volumes = {ramp,
                   homogeneous({0.1, 0.2, 0.3}, {0, 0.1, 0}, 0, Box3d({-2, -2, -2}, {2, 2, 0.5}))};
  scene.materials = {diffuse(0.5)};
  scene.meshes = {plane(5, 3, 0)};
  const World world(scene);
  Sensor sensor({0.1, 0.2, -4}, {0.1, 0.2, 3});
  sensor.expose(world, options_of(Transport::Cached, 256));
  // Of the ramp, and of its descent to zero over one voxel at either end.
  const double ramp_integral = 3 + 0.5 * (2.0 / 16) * (0.5 + 2.5);
  RgbD expected;
  for (int c = 0; c < 3; ++c)
    expected[c] = std::exp(-ramp_integral * scene.volumes[0].sigma_t()[c] -
                           2.5 * scene.volumes[1].sigma_t()[c]);
  expect_near(sensor.of([](const PixelResult& p) { return p.transmittance; }), expected, 1e-6,
              0.03);
}

TEST(PathTracer, EmissionGridsGlowWithoutDensity) {
  const Box3d box({-1, -1, -1}, {1, 1, 1});
  Volume v = homogeneous(RgbD(0.0), RgbD(0.0));
  v.density = test::dense_grid(box, 9, [](const Vec3d&) { return 0.0; });
  v.emission.mode = Emission::Mode::Grid;
  v.emission.scale = 2;
  v.emission.color = {1, 0.5, 0.25};
  v.emission.grid = {test::dense_grid(box, 33, [](const Vec3d& p) { return 1 + p.z * p.x; })};
  Scene scene;
  scene.volumes = {v};
  const World world(scene);
  Sensor sensor({0.5, 0.1, -4}, {0.5, 0.1, 3});
  sensor.expose(world, options_of(Transport::Cached, 256));
  // The lattice continues to zero one node (1/16) outside the box.
  const double expected = 2 * (2 + 1.0 / 16);
  expect_near(sensor.layer(Layer::VolumeEmission), RgbD(1, 0.5, 0.25) * expected, 1e-5);
}

// HARD_CASES N11: no NaN, no negative light, no endless loop.
TEST(PathTracer, ExtremeDensitiesStayFinite) {
  for (const double sigma : {1e-30, 1e-6, 1e6, 1e30}) {
    Scene scene;
    const Box3d box({-1, -1, -1}, {1, 1, 1});
    // Null collisions in a brick's empty corners bound what a grid may hold.
    const double in_grid = std::min(sigma, 1e3);
    scene.volumes = {lumpy(box, RgbD(in_grid), {0, in_grid / 2, in_grid}, 0.9),
                     homogeneous({0, sigma, 0}, {sigma, sigma, 0}, -0.9, box)};
    scene.volumes[0].emission.mode = Emission::Mode::Density;
    EnvironmentLight sky;
    scene.lights = {sky, PointLight{{0, 0, 0}, Rgb(1.0f)}, PointLight{{0, 0, 0.999}, Rgb(1.0f)}};
    scene.materials = {diffuse(0.5)};
    scene.meshes = {plane(3, -1, 0)};
    const World world(scene);
    for (const Transport transport : {Transport::Cached, Transport::Full}) {
      Sensor sensor({0.3, 0.2, 3}, {0, 0, 0}, 4);
      sensor.expose(world, options_of(transport, 16));
      for (int i = 0; i < 16; ++i) {
        const PixelResult& p = sensor.film().at(i % 4, i / 4);
        for (int c = 0; c < 3; ++c) {
          EXPECT_TRUE(std::isfinite(p.beauty()[c])) << sigma;
          EXPECT_GE(p.beauty()[c], 0) << sigma;
          EXPECT_GE(p.transmittance[c], 0) << sigma;
        }
      }
      const RgbD t = sensor.of([](const PixelResult& p) { return p.transmittance; }).mean;
      if (sigma < 1e-5) {
        EXPECT_NEAR(t.g, 1, 1e-4);
      } else {
        EXPECT_EQ(t.r, 0);
      }
    }
  }
}

// An endless medium that one channel does not see must not keep a ray busy for ever.
TEST(PathTracer, EndlessMediumOfOneColourEnds) {
  Scene scene;
  Volume v = homogeneous({1, 1, 0}, {0.5, 0.5, 0});
  v.emission.mode = Emission::Mode::Density;
  scene.volumes = {v};
  const World world(scene);
  Sensor sensor({0, 0, 0}, {0, 0, 1}, 8);
  // Emission 1 sigma_t and nothing behind it: radiance 1 without scattering.
  sensor.expose(world, options_of(Transport::Cached, 64));
  expect_near(sensor.layer(Layer::VolumeEmission), {1, 1, 0}, 1e-6, 0.05);
  sensor.expose(world, options_of(Transport::Full, 4));
  EXPECT_EQ(sensor.beauty().mean.b, 0);
}

struct Furnace {
  double tau, g;
  bool is_lumpy;
};
class WhiteFurnace : public testing::TestWithParam<Furnace> {};

// Nothing is lost and nothing won: radiance is that of the environment everywhere (HARD_CASES N25).
TEST_P(WhiteFurnace, LooksLikeItsEnvironment) {
  const auto [tau, g, is_lumpy] = GetParam();
  const Box3d box({-1, -1, -1}, {1, 1, 1});
  Scene scene;
  const RgbD sigma(tau / 2, tau / 3, tau / 4);
  scene.volumes = {is_lumpy ? lumpy(box, sigma, RgbD(0.0), g)
                            : homogeneous(sigma, RgbD(0.0), g, box)};
  EnvironmentLight environment;
  environment.radiance = Rgb(1.0f);
  scene.lights = {environment};
  scene.materials = {diffuse(1)};
  TriangleMesh card = plane(0.4, -0.2, 0);
  scene.meshes = {card};
  const World world(scene);
  for (const Vec3d& target : {Vec3d(0.1, 0.2, -0.2), Vec3d(0.7, 0.6, 0.1)}) {
    Sensor sensor({1, 2, 3}, target);
    sensor.expose(world, options_of(Transport::Full, 64));
    expect_near(sensor.beauty(), RgbD(1.0), 0.002, 0.02);
  }
}
INSTANTIATE_TEST_SUITE_P(Media, WhiteFurnace,
                         testing::Values(Furnace{0.5, 0, false}, Furnace{10, 0, false},
                                         Furnace{10, 0.6, false}, Furnace{3, -0.4, true},
                                         Furnace{10, 0.6, true}));

// A closed room of albedo rho whose walls glow holds radiance e / (1 - rho), smoke of albedo 1 or
// not.
TEST(PathTracer, GlowingRoomWithSmokeIsAFurnace) {
  Material wall = lamp(0.7, false);
  wall.albedo = Rgb(0.5f);
  Scene scene;
  scene.materials = {wall};
  scene.meshes = {room(1, 0)};
  scene.volumes = {homogeneous({2, 1, 0.5}, RgbD(0.0), 0.5)};
  const World world(scene);
  Sensor sensor({0.1, 0.2, 0.3}, {1, -0.3, 0.2});
  sensor.expose(world, options_of(Transport::Full, 64));
  expect_near(sensor.beauty(), RgbD(1.4), 1e-5, 0.01);
}

// E_0 sees the walls' glow alone; every further bounce adds one factor of rho.
TEST(PathTracer, BouncesAddTheTermsOfASeries) {
  const double e = 0.7, rho = 0.5;
  Material wall = lamp(e, false);
  wall.albedo = Rgb(float(rho));
  Scene scene;
  scene.materials = {wall};
  scene.meshes = {room(1, 0)};
  const World world(scene);
  Sensor sensor({0.1, 0.2, 0.3}, {1, -0.3, 0.2}, 4);
  double expected = 0;
  for (int bounces = 0; bounces <= 3; ++bounces) {
    if (bounces == 1) expected += rho * e;
    if (bounces > 0) expected += rho * e * std::pow(rho, bounces);
    sensor.expose(world, options_of(Transport::Cached, 16, bounces));
    expect_near(sensor.layer(Layer::DiffuseIndirect), RgbD(expected), 1e-5);
    expect_near(sensor.layer(Layer::Emission), RgbD(e), 1e-5);
    expect_near(sensor.layer(Layer::DiffuseDirect), RgbD(0.0));
  }
  sensor.expose(world, options_of(Transport::Full, 256));
  expect_near(sensor.layer(Layer::DiffuseIndirect), RgbD(rho * e / (1 - rho)), 1e-4);
}

Scene smoky_corner(bool direct, float roughness) {
  Scene scene;
  Material floor = diffuse(0.3);
  floor.specular = {0.5f, 0.4f, 0.3f};
  floor.roughness = roughness;
  scene.materials = {floor, lamp(5, direct), diffuse(0.6)};
  TriangleMesh light = plane(0.3, 0.9, 1);
  for (auto& t : light.triangles) std::swap(t[1], t[2]);
  scene.meshes = {plane(2, 0, 0), light, room(3, 2)};
  scene.volumes = {
      lumpy(Box3d({-0.6, -0.6, 0.2}, {0.6, 0.6, 1.4}), {1.5, 1, 0.8}, {0.1, 0.3, 0.2}, 0.4)};
  return scene;
}

// Lamps that are sampled, weighted against reflected and scattered rays that hit them, must give
// what the same lamps give when they are only ever hit.
TEST(PathTracer, SampledLampsGiveWhatHitLampsGive) {
  for (const float roughness : {0.8f, 0.25f}) {
    Measured totals[2];
    for (const bool direct : {false, true}) {
      const World world(smoky_corner(direct, roughness));
      Sensor sensor({1.2, 0.3, 1}, {-0.3, 0.1, 0}, 32);
      sensor.expose(world, options_of(Transport::Full, direct ? 64 : 256));
      totals[direct] = sensor.beauty();
    }
    for (int c = 0; c < 3; ++c) {
      const double error = std::hypot(totals[0].error[c], totals[1].error[c]);
      EXPECT_NEAR(totals[0].mean[c], totals[1].mean[c], 4 * error) << "roughness " << roughness;
      EXPECT_LT(error, 0.02 * totals[1].mean[c]);
    }
  }
}

// With every bounce and no medium both transports sample the same light.
TEST(PathTracer, CachedTransportConvergesToFullWithoutSmoke) {
  Scene scene = smoky_corner(true, 0.5f);
  scene.volumes.clear();
  const World world(scene);
  Sensor sensor({1.2, 0.3, 1}, {-0.3, 0.1, 0}, 24);
  sensor.expose(world, options_of(Transport::Full, 64));
  const Measured full[4] = {sensor.layer(Layer::DiffuseDirect),
                            sensor.layer(Layer::DiffuseIndirect), sensor.layer(Layer::GlossyDirect),
                            sensor.layer(Layer::GlossyIndirect)};
  sensor.expose(world, options_of(Transport::Cached, 64, 40));
  const Layer layers[4] = {Layer::DiffuseDirect, Layer::DiffuseIndirect, Layer::GlossyDirect,
                           Layer::GlossyIndirect};
  for (int l = 0; l < 4; ++l) {
    const Measured cached = sensor.layer(layers[l]);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(cached.mean[c], full[l].mean[c],
                  4 * std::hypot(cached.error[c], full[l].error[c]))
          << layer_name(layers[l]);
      EXPECT_GT(full[l].mean[c], 0);
    }
  }
}

// With every bounce and every order of scattering too; lamps are weighted against scattered rays.
TEST(PathTracer, CachedTransportOfEveryOrderConvergesToFull) {
  Scene scene = smoky_corner(true, 0.5f);
  scene.volumes[0].emission.mode = Emission::Mode::Density;
  scene.volumes[0].emission.scale = 0.05;
  scene.lights = {PointLight{{0.2, 0.1, 0.7}, Rgb(0.2f)}, EnvironmentLight{}};
  scene.meshes.pop_back();  // The sky shows.
  const World world(scene);
  Sensor sensor({1.2, 0.3, 1}, {-0.3, 0.1, 0}, 32);
  sensor.expose(world, options_of(Transport::Full, 128));
  std::array<Measured, kLayerCount> full, cached;
  for (int l = 0; l < kLayerCount; ++l) full[l] = sensor.layer(Layer(l));
  PathTracerOptions options = options_of(Transport::Cached, 128, 40);
  options.volume_bounces = kEveryOrder;
  sensor.expose(world, options);
  for (int l = 0; l < kLayerCount; ++l) {
    cached[l] = sensor.layer(Layer(l));
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(cached[l].mean[c], full[l].mean[c],
                  4 * std::hypot(cached[l].error[c], full[l].error[c]) + 1e-9)
          << layer_name(Layer(l));
  }
  for (const Layer layer : {Layer::VolumeDirect, Layer::VolumeIndirect, Layer::DiffuseIndirect})
    for (int c = 0; c < 3; ++c)
      EXPECT_LT(std::hypot(cached[int(layer)].error[c], full[int(layer)].error[c]),
                0.02 * full[int(layer)].mean[c])
          << layer_name(layer);
}

TEST(PathTracer, WithoutVolumeBouncesTheMediumOnlyDims) {
  const World world(smoky_corner(true, 0.5f));
  PathTracerOptions options = options_of(Transport::Cached, 16, 0);
  options.volume_bounces = 0;
  Sensor sensor({1.2, 0.3, 1}, {-0.3, 0.1, 0});
  sensor.expose(world, options);
  for (const Layer l :
       {Layer::VolumeDirect, Layer::VolumeIndirect, Layer::DiffuseIndirect, Layer::GlossyIndirect})
    EXPECT_EQ(sensor.layer(l).mean, RgbD(0.0)) << layer_name(l);
  EXPECT_LT(sensor.of([](const PixelResult& p) { return p.transmittance; }).mean.r, 0.9);
  EXPECT_GT(sensor.layer(Layer::DiffuseDirect).mean.r, 0);
}

bool same(const PixelResult& a, const PixelResult& b) {
  return a.layers == b.layers && a.alpha == b.alpha && a.z == b.z && a.position == b.position &&
         a.transmittance == b.transmittance && a.cost == b.cost;
}

class Picture : public testing::Test {
 protected:
  static Camera camera() {
    Camera c;
    c.position = {1.2, 0.3, 1};
    c.look_at = {-0.3, 0.1, 0.2};
    c.up = {0, 0, 1};
    c.fov_deg = 70;
    return c;
  }
  const World world_{smoky_corner(true, 0.5f)};
  const CameraRays rays_{camera(), 40, 28};
};

TEST_F(Picture, DoesNotDependOnThreads) {
  PixelFilm one(40, 28), three(40, 28);
  PathTracerOptions options = options_of(Transport::Full, 4);
  options.threads = 1;
  const PathTracerResult a = trace_paths(world_, rays_, options, one);
  options.threads = 3;
  const PathTracerResult b = trace_paths(world_, rays_, options, three);
  for (int y = 0; y < 28; ++y)
    for (int x = 0; x < 40; ++x) ASSERT_TRUE(same(one.at(x, y), three.at(x, y))) << x << ' ' << y;
  EXPECT_EQ(a.rays, b.rays);
  EXPECT_EQ(a.lookups, b.lookups);
  EXPECT_EQ(a.estimated_error, b.estimated_error);
}

TEST_F(Picture, CropShowsThePixelsOfTheWhole) {
  PixelFilm whole(40, 28), part(40, 28);
  PathTracerOptions options = options_of(Transport::Cached, 2);
  trace_paths(world_, rays_, options, whole);
  options.crop_x = {0.25, 0.5};
  options.crop_y = {0.5, 1};
  trace_paths(world_, rays_, options, part);
  for (int y = 0; y < 28; ++y)
    for (int x = 0; x < 40; ++x)
      EXPECT_TRUE(
          same(part.at(x, y), x >= 10 && x < 20 && y >= 14 ? whole.at(x, y) : PixelResult{}))
          << x << ' ' << y;
}

TEST_F(Picture, NoiseStopsAtTheErrorAskedFor) {
  PixelFilm film(40, 28);
  PathTracerOptions options = options_of(Transport::Cached, 1);
  options.noise = 0.03;
  options.max_samples = 4096;
  double last = 0;
  options.threads = 1;
  options.progress = [&](double fraction) {
    EXPECT_GE(fraction, last);
    last = fraction;
  };
  const PathTracerResult result = trace_paths(world_, rays_, options, film);
  EXPECT_LE(result.estimated_error, 0.03);
  EXPECT_GT(result.estimated_error, 0.003);
  EXPECT_GE(result.samples, 16);
  EXPECT_LT(result.samples, 4096);
  EXPECT_EQ(last, 1);
}

TEST_F(Picture, StopsWhenAsked) {
  PixelFilm film(40, 28);
  PathTracerOptions options = options_of(Transport::Cached, 1 << 20);
  options.stop_requested = [] { return true; };
  EXPECT_EQ(trace_paths(world_, rays_, options, film).samples, 0);
}

TEST_F(Picture, DataLayersDescribeTheNearestSurface) {
  PixelFilm film(40, 28);
  trace_paths(world_, rays_, options_of(Transport::Cached, 16), film);
  const Ray ray = rays_.ray(20.5, 26.5);
  const Hit hit = world_.tracer().intersect(ray);
  const PixelResult& p = film.at(20, 26);
  EXPECT_EQ(p.alpha, 1);
  EXPECT_NEAR(p.z, (hit.position - ray.origin).dot(rays_.forward()), 0.05);
  EXPECT_NEAR((p.position - hit.position).length(), 0, 0.05);
  EXPECT_NEAR(p.normal.dot(hit.normal), 1, 1e-9);
  EXPECT_NEAR(p.albedo.r, 0.8, 1e-6);
  EXPECT_GT(p.cost, 3);
}

}  // namespace
}  // namespace brume
