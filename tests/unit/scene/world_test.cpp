#include "scene/world.h"

#include <gtest/gtest.h>

#include <functional>

#include "core/error.h"

namespace brume {
namespace {

Scene small_scene() {
  Scene scene;
  Material white, lamp, glow;
  lamp.emission = {5, 4, 3};
  lamp.albedo = Rgb(0.0f);
  glow.emission = Rgb(2.0f);
  glow.direct = false;
  glow.two_sided = true;
  scene.materials = {white, lamp, glow};
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 0, 1},
                    {0, 1, 1}, {0, 0, 2}, {1, 0, 2}, {0, 1, 2}};
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}, {6, 7, 8}};
  mesh.materials = {0, 1, 2};
  scene.meshes = {mesh};
  scene.lights = {PointLight{{0, 3, 0}, Rgb(1.0f)},
                  QuadLight{{0, 0, 5}, {1, 0, 0}, {0, 1, 0}, Rgb(7.0f)}};
  Volume haze;
  haze.bounds = Box3d({-1, -1, -1}, {2, 2, 6});
  haze.sigma_s = RgbD(0.1);
  scene.volumes = {haze};
  return scene;
}

Hit look(const World& world, double z_from, double z_direction) {
  return world.tracer().intersect({{0.2, 0.2, z_from}, {0, 0, z_direction}});
}

TEST(World, EmittersBecomeLights) {
  const World world(small_scene());
  ASSERT_EQ(world.lights().size(), 3u);
  EXPECT_EQ(world.lights()[0]->kind(), Light::Kind::Point);
  EXPECT_EQ(world.lights()[1]->kind(), Light::Kind::Quad);
  EXPECT_EQ(world.lights()[2]->kind(), Light::Kind::Mesh);
  EXPECT_TRUE(world.has_gathered_emitters());
  EXPECT_FALSE(world.has_glossy());

  const Hit lamp = look(world, 1.5, -1), glow = look(world, 2.5, -1), white = look(world, 0.5, -1);
  EXPECT_EQ(world.light_at(lamp), 2);
  EXPECT_EQ(world.light_at(glow), -1);
  EXPECT_EQ(world.light_at(white), -1);
  EXPECT_EQ(world.emission(lamp, {0, 0, 1}), RgbD(5, 4, 3));
  EXPECT_EQ(world.emission(look(world, 0.5, 1), {0, 0, -1}), RgbD());
  EXPECT_EQ(world.emission(glow, {0, 0, 1}), RgbD(2.0));
  EXPECT_EQ(world.emission(look(world, 1.5, 1), {0, 0, -1}), RgbD(2.0));
  EXPECT_EQ(world.emission(white, {0, 0, 1}), RgbD());
}

TEST(World, QuadLightsAreSeenAndBlockLight) {
  const World world(small_scene());
  const Hit front = look(world, 6, -1), back = look(world, 4, 1);
  EXPECT_NEAR(front.t, 1, 1e-12);
  EXPECT_EQ(world.light_at(front), 1);
  EXPECT_EQ(world.emission(front, {0, 0, 1}), RgbD(7.0));
  EXPECT_EQ(world.emission(back, {0, 0, -1}), RgbD());
  EXPECT_FALSE(world.material(front).reflects());
  EXPECT_TRUE(world.tracer().is_occluded({{0.2, 0.2, 4}, {0, 0, 1}, 2}));
}

TEST(World, BoundsHoldGeometryAndMedia) {
  const World world(small_scene());
  EXPECT_EQ(world.bounds().min, Vec3d(-1, -1, -1));
  EXPECT_EQ(world.bounds().max, Vec3d(2, 2, 6));
  EXPECT_NEAR(world.diagonal(), std::sqrt(9 + 9 + 49), 1e-12);
}

TEST(World, BackgroundIsTheSumOfEnvironments) {
  Scene scene = small_scene();
  EnvironmentLight sky;
  sky.radiance = {1, 2, 3};
  scene.lights.push_back(sky);
  scene.lights.push_back(sky);
  const World world(scene);
  EXPECT_EQ(world.environment_lights(), (std::vector<int>{2, 3}));
  EXPECT_EQ(world.background({0, 1, 0}), RgbD(2, 4, 6));
}

TEST(World, RefusesLightFromInfinityThroughAnEndlessMedium) {
  Scene scene = small_scene();
  scene.volumes[0].bounds = Box3d(Vec3d(-kInfinity), Vec3d(kInfinity));
  EXPECT_NO_THROW(World{scene});
  scene.lights.push_back(DirectionalLight{});
  try {
    const World world(scene);
    FAIL() << "accepted";
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
    EXPECT_NE(std::string(e.what()).find("/lights/2"), std::string::npos) << e.what();
  }
  scene.lights.back() = EnvironmentLight{};
  EXPECT_THROW(World{scene}, Error);
}

TEST(World, FingerprintSeesWhatIrradianceDependsOn) {
  const Fingerprint base = World(small_scene()).fingerprint();
  EXPECT_EQ(World(small_scene()).fingerprint(), base);
  const auto changed = [&](const std::function<void(Scene&)>& change) {
    Scene scene = small_scene();
    change(scene);
    return World(scene).fingerprint() != base;
  };
  EXPECT_TRUE(changed([](Scene& s) { s.unit = 0.1; }));
  EXPECT_TRUE(changed([](Scene& s) { s.meshes[0].positions[4].x += 1e-15; }));
  EXPECT_TRUE(changed([](Scene& s) { s.meshes[0].casts_shadow = false; }));
  EXPECT_TRUE(changed([](Scene& s) { s.meshes[0].materials[0] = 2; }));
  EXPECT_TRUE(changed([](Scene& s) { s.meshes[0].normals.assign(9, Vec3f(0, 0, 1)); }));
  EXPECT_TRUE(changed([](Scene& s) { s.materials[0].albedo.g = 0.25f; }));
  EXPECT_TRUE(changed([](Scene& s) { s.materials[1].two_sided = true; }));
  EXPECT_TRUE(changed([](Scene& s) { std::get<PointLight>(s.lights[0]).intensity.b = 2; }));
  EXPECT_TRUE(changed([](Scene& s) { std::get<QuadLight>(s.lights[1]).edge_u.x = 2; }));
  EXPECT_TRUE(changed([](Scene& s) { s.volumes[0].sigma_a.r = 0.5; }));
  EXPECT_TRUE(changed([](Scene& s) { s.volumes[0].phase = HenyeyGreenstein(0.1); }));
  EXPECT_TRUE(changed([](Scene& s) { s.lights.pop_back(); }));
  EXPECT_FALSE(changed([](Scene& s) { s.meshes[0].name = "other"; }));
  EXPECT_FALSE(changed([](Scene& s) { s.materials[0].name = "other"; }));
  EXPECT_FALSE(changed([](Scene& s) { s.camera = Camera{}; }));
  EXPECT_FALSE(changed([](Scene& s) { s.file = "other.json"; }));
  EXPECT_FALSE(changed([](Scene& s) { s.film.width = 3; }));
}

TEST(World, BadTrianglesAndFlatLightsChangeNothing) {
  Scene scene = small_scene();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  scene.meshes[0].positions.push_back(Vec3d(nan));
  scene.meshes[0].triangles.push_back({{0, 1, 9}});
  scene.meshes[0].triangles.push_back({{0, 0, 1}});
  scene.meshes[0].materials.insert(scene.meshes[0].materials.end(), {1, 1});
  scene.lights.push_back(QuadLight{{0, 0, 5}, {1, 0, 0}, {2, 0, 0}, Rgb(7.0f)});
  const World world(scene), clean(small_scene());
  EXPECT_EQ(world.lights().size(), 4u);
  EXPECT_EQ(world.bounds().min, clean.bounds().min);
  EXPECT_EQ(look(world, 1.5, -1).t, look(clean, 1.5, -1).t);
  EXPECT_EQ(world.lights()[3]->importance(), clean.lights()[2]->importance());
  const LightSample s = world.lights()[2]->sample({0, 0, 0}, {0.5, 0.5});
  EXPECT_EQ(s.weight, RgbD());
}

TEST(World, EmptySceneIsBlackAndEmpty) {
  const World world{Scene{}};
  EXPECT_FALSE(look(world, 0, 1).is_hit());
  EXPECT_TRUE(world.lights().empty());
  EXPECT_EQ(world.background({0, 0, 1}), RgbD());
}

}  // namespace
}  // namespace brume
