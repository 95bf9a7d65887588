// The scenes of the talk: that they load, take their parameters, and hold what they are made to
// show.
#include "data_gen/talk_scenes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "core/error.h"
#include "scene/scene_file.h"
#include "scene/world.h"
#include "support/scratch_folder.h"

namespace brume {
namespace {

namespace fs = std::filesystem;

TalkSceneOptions small() {
  TalkSceneOptions options;
  options.size_px = 32;
  options.resolution = 12;
  return options;
}

Scene load(const std::string& name, const TalkSceneOptions& options = small()) {
  const ScratchFolder folder;
  return load_scene(write_talk_scene(name, folder.path(), options).front(), {});
}

// Points of the ground that figures show, or of a floor, away from the edges of what stands on it.
std::vector<Vec3d> floor_points(const Box3d& area) {
  std::vector<Vec3d> points;
  for (int i = 0; i < 37; ++i)
    for (int j = 0; j < 37; ++j)
      points.push_back(
          area.min + Vec3d(area.size().x * (i + 0.45) / 37, 1e-4, area.size().z * (j + 0.55) / 37));
  return points;
}

// Of `points`, those that light straight from light `l` reaches.
std::size_t count_lit(const World& world, std::size_t l, const std::vector<Vec3d>& points) {
  return static_cast<std::size_t>(std::count_if(points.begin(), points.end(), [&](const Vec3d& p) {
    const LightSample s = world.lights()[l]->sample(p, {0.5, 0.5});
    return !is_black(s.weight) && s.direction.y > 0 &&
           !world.tracer().is_occluded({p, s.direction, s.distance * (1 - 1e-5)});
  }));
}

class TalkScenes : public testing::TestWithParam<std::string> {};

TEST_P(TalkScenes, LoadWithoutAWarning) {
  const Scene scene = load(GetParam());
  EXPECT_TRUE(scene.warnings.empty()) << scene.warnings.front();
  EXPECT_EQ(scene.film.width, 32);
  EXPECT_FALSE(scene.meshes.empty());
  EXPECT_FALSE(scene.lights.empty());
  EXPECT_FALSE(scene.volumes.empty());
  // Gradients are measured on single scattering; the demo shows all of it.
  if (GetParam() != "smoky-cornell") {
    EXPECT_EQ(scene.render.volume_bounces, 1);
  }
  EXPECT_EQ(scene.bad_voxels.total(), 0u);
  EXPECT_TRUE(scene.camera.has_value());
}

TEST_P(TalkScenes, AreTheSameBytesForAnyNumberOfThreads) {
  const ScratchFolder a, b;
  TalkSceneOptions options = small();
  options.threads = 1;
  const auto first = write_talk_scene(GetParam(), a.path(), options);
  options.threads = 3;
  const auto second = write_talk_scene(GetParam(), b.path(), options);
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t i = 0; i < first.size(); ++i)
    EXPECT_EQ(read_bytes(first[i]), read_bytes(second[i])) << first[i];
}

TEST_P(TalkScenes, TakeTheMediumThatIsAskedFor) {
  TalkSceneOptions options = small();
  options.albedo = 0.25;
  options.anisotropy = -0.5;
  const Scene once = load(GetParam(), options);
  options.density = 3;
  const Scene thrice = load(GetParam(), options);
  for (std::size_t i = 0; i < once.volumes.size(); ++i) {
    const Volume &v = once.volumes[i], &w = thrice.volumes[i];
    EXPECT_NEAR(w.sigma_t().r, 3 * v.sigma_t().r, 1e-5 * w.sigma_t().r);
    EXPECT_NEAR(v.sigma_s.r, 0.25 * v.sigma_t().r, 1e-5);
    EXPECT_FLOAT_EQ(static_cast<float>(v.phase.g()), -0.5f);
  }
}

INSTANTIATE_TEST_SUITE_P(All, TalkScenes, testing::ValuesIn(talk_scene_names()),
                         [](const auto& instance) {
                           std::string name = instance.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST(TalkScene, AbsorbingSendsItsLampOntoThePanelAlone) {
  const Scene scene = load("absorbing");
  const World world(scene);
  EXPECT_EQ(count_lit(world, 0, floor_points(talk_ground())), 0u);
  const auto& spot = std::get<SpotLight>(scene.lights.at(0));
  const Frame frame(spot.direction);
  const double angle = spot.outer_deg * kPi / 180;
  for (int i = 0; i < 64; ++i) {
    const double turn = 2 * kPi * i / 64;
    const Hit hit = world.tracer().intersect(
        {spot.position, frame.to_world({std::sin(angle) * std::cos(turn),
                                        std::sin(angle) * std::sin(turn), std::cos(angle)})});
    ASSERT_TRUE(hit.is_hit());
    EXPECT_EQ(world.material(hit).name, "panel") << i;
  }
}

TEST(TalkScene, ScatteringSendsTheGroundNoLightStraightFromTheLamp) {
  const World world(load("scattering"));
  EXPECT_EQ(count_lit(world, 0, floor_points(talk_ground())), 0u);
  // Without the plate it would.
  EXPECT_EQ(count_lit(world, 0, {Vec3d(0, 1.7, 0)}), 1u);
}

TEST(TalkScene, NoWallsIsOneFlatGroundUnderAMediumThatEndsInTheAir) {
  const Scene scene = load("no-walls");
  ASSERT_EQ(scene.meshes.size(), 1u);
  for (const Vec3d& p : scene.meshes[0].positions) EXPECT_EQ(p.y, 0);
  const Volume& cloud = scene.volumes.at(0);
  EXPECT_GT(cloud.density_at({0.45, 0.75, -0.35}), 0.5);
  for (const Vec3d& p :
       {Vec3d(-1.95, 1, 0), Vec3d(1.95, 1, 0), Vec3d(0, 1, -1.95), Vec3d(0, 2.4, 0)})
    EXPECT_LT(cloud.density_at(p), 0.01);
}

TEST(TalkScene, WindowLetsTheSunOntoPartOfTheFloorAndNowhereElse) {
  const World world(load("window"));
  const auto floor = floor_points({{-2, 0, -2.5}, {2, 0, 2.5}});
  const std::size_t lit = count_lit(world, 0, floor);
  EXPECT_GT(lit, floor.size() / 20);
  EXPECT_LT(lit, floor.size() / 3);
  // More panes, more bars between them.
  TalkSceneOptions options = small();
  options.detail = 8;
  EXPECT_LT(count_lit(World(load("window", options)), 0, floor), lit);
}

TEST(TalkScene, DiscoThrowsEachBeamPastItsOwnBall) {
  const Scene scene = load("disco");
  const World world(scene);
  ASSERT_GT(scene.lights.size(), 20u);
  for (std::size_t l = 0; l + 1 < scene.lights.size(); ++l) {
    const auto& spot = std::get<SpotLight>(scene.lights[l]);
    const Hit hit = world.tracer().intersect({spot.position, spot.direction});
    ASSERT_TRUE(hit.is_hit()) << "the room is closed";
    EXPECT_NE(world.material(hit).name, "ball");
  }
  TalkSceneOptions options = small();
  options.detail = 2;
  EXPECT_LT(load("disco", options).lights.size(), scene.lights.size());
  options.contrast = 0.5;
  EXPECT_FALSE(load("disco", options).volumes.at(0).is_homogeneous());
}

TEST(TalkScene, RefusesWhatIsOutOfRange) {
  const ScratchFolder folder;
  const auto refused = [&](auto change) {
    TalkSceneOptions options = small();
    change(options);
    EXPECT_THROW(write_talk_scene("window", folder.path(), options), Error);
  };
  refused([](TalkSceneOptions& o) { o.size_px = 0; });
  refused([](TalkSceneOptions& o) { o.resolution = 1; });
  refused([](TalkSceneOptions& o) { o.density = -1; });
  refused([](TalkSceneOptions& o) { o.density = std::nan(""); });
  refused([](TalkSceneOptions& o) { o.albedo = 1.5; });
  refused([](TalkSceneOptions& o) { o.anisotropy = 1; });
  refused([](TalkSceneOptions& o) { o.contrast = -0.1; });
  refused([](TalkSceneOptions& o) { o.detail = 0; });
  EXPECT_THROW(write_talk_scene("windows", folder.path(), small()), Error);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

}  // namespace
}  // namespace brume
