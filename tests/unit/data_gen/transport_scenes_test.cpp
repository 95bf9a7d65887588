// The slab and the furnace: that they load, take their parameters, and that cameras look at what
// they are there for. What they look like is tests/agreement/transport_scenes_test.cpp.
#include "data_gen/transport_scenes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <string>

#include "core/error.h"
#include "scene/camera_rays.h"
#include "scene/scene_file.h"
#include "scene/world.h"
#include "support/scratch_folder.h"

namespace brume {
namespace {

namespace fs = std::filesystem;

Scene load(const SlabOptions& options) {
  const ScratchFolder folder;
  Scene scene = load_scene(write_slab(folder.path(), options).front(), {});
  EXPECT_TRUE(scene.warnings.empty()) << scene.warnings.front();
  return scene;
}

Scene load(const FurnaceOptions& options) {
  const ScratchFolder folder;
  Scene scene = load_scene(write_furnace(folder.path(), options).front(), {});
  EXPECT_TRUE(scene.warnings.empty()) << scene.warnings.front();
  return scene;
}

// Of the straight way along y at (x, z), by a rule much finer than the voxels.
double depth_at(const Scene& scene, double x, double z) {
  constexpr int kSteps = 100'000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i)
    sum += scene.volumes.at(0).density_at({x, -1 + 3 * (i + 0.5) / kSteps, z});
  return sum * 3 / kSteps * scene.volumes.at(0).sigma_t().g;
}

TEST(SlabScene, HasTheMediumThatIsAskedFor) {
  for (const int resolution : {0, 2, 5, 8}) {
    SlabOptions options;
    options.optical_depth = 2.5;
    options.albedo = 0.75;
    options.anisotropy = -0.5;
    options.width = 12;
    options.resolution = resolution;
    const Scene scene = load(options);
    const Volume& slab = scene.volumes.at(0);
    EXPECT_EQ(slab.is_homogeneous(), resolution == 0);
    EXPECT_NEAR(slab.sigma_s.g, 0.75 * slab.sigma_t().g, 1e-6);
    EXPECT_FLOAT_EQ(static_cast<float>(slab.phase.g()), -0.5f);
    EXPECT_NEAR(depth_at(scene, 0.1, -0.2), 2.5, 1e-3) << resolution;
    EXPECT_NEAR(depth_at(scene, -5.9, 5.9), 2.5, 1e-3) << resolution;
    EXPECT_EQ(slab.density_at({0, -1e-6, 0}), 0);
    EXPECT_EQ(slab.density_at({0, 1 + 1e-6, 0}), 0);
  }
}

TEST(SlabScene, IsWiderWhereLightGoesFarther) {
  EXPECT_EQ(default_slab_width(8, 0), 20);
  EXPECT_EQ(default_slab_width(8, -0.9), 20);
  EXPECT_DOUBLE_EQ(default_slab_width(0.2, 0), 60);
  EXPECT_DOUBLE_EQ(default_slab_width(0.2, 0.5), 120);
  SlabOptions options;
  options.optical_depth = 0.2;
  EXPECT_EQ(load(options).volumes.at(0).bounds.max, Vec3d(30, 1, 30));
}

TEST(SlabScene, CamerasSeeTheirReceiversAndNothingElse) {
  const Scene scene = load(SlabOptions{});
  const World world(scene);
  for (const auto& [name, side] : {std::pair("reflection", -1.0), std::pair("transmission", 1.0)})
    // The corners of a wide picture too.
    for (const double x : {0.0, 16.0, 32.0})
      for (const double y : {0.0, 9.0, 18.0}) {
        const Hit hit =
            world.tracer().intersect(CameraRays(scene.find_camera(name), 32, 18).ray(x, y));
        ASSERT_TRUE(hit.is_hit()) << name;
        EXPECT_NEAR(hit.normal.y, side, 1e-6) << name;
        EXPECT_NEAR(hit.position.y, side < 0 ? 1.05 : -0.05, 1e-6) << name;
        // The way there and the receiver itself are outside the slab.
        EXPECT_LT(hit.t, 0.05) << name;
      }
  for (const char* name : {"above", "below"})
    for (const double x : {0.0, 32.0}) {
      const Ray ray = CameraRays(scene.find_camera(name), 32, 18).ray(x, 9);
      EXPECT_FALSE(world.tracer().intersect(ray).is_hit()) << name;
      EXPECT_GT(std::abs(ray.direction.y), 0.9999) << name;
    }
  // Neither keeps the beam from the slab.
  EXPECT_FALSE(world.tracer().is_occluded({Vec3d(0, 0.5, 0), Vec3d(0, 1, 0), kInfinity}));
}

TEST(SlabScene, FullLightShowsAsOne) {
  SlabOptions options;
  const Scene beam = load(options);
  ASSERT_EQ(beam.lights.size(), 1u);
  const auto& sun = std::get<DirectionalLight>(beam.lights[0]);
  EXPECT_EQ(sun.direction, Vec3d(0, -1, 0));
  EXPECT_NEAR(sun.irradiance.g * beam.materials.at(0).albedo.g / kPi, 1, 1e-6);

  options.incidence = SlabOptions::Incidence::Diffuse;
  // The sky's file must outlive this.
  const ScratchFolder folder;
  const Scene scene = load_scene(write_slab(folder.path(), options).front(), {});
  const World world(scene);
  const Light& sky = *world.lights().at(0);
  for (const double y : {1.0, 0.5, 0.1, 0.01, -0.01, -0.1, -0.5, -1.0}) {
    const double x = std::sqrt(1 - y * y);
    for (const Vec3d& d : {Vec3d(x, y, 0), Vec3d(0, y, -x), Vec3d(-0.6 * x, y, 0.8 * x)})
      EXPECT_EQ(sky.radiance(d).g, y > 0 ? 1 : 0) << d.y;
  }
  // The flux onto a level plane, half of whose light comes from below 45 degrees.
  constexpr int kSteps = 200'000;
  double flux = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double y = (i + 0.5) / kSteps;
    flux += 2 * y * sky.radiance({std::sqrt(1 - y * y), y, 0}).g / kSteps;
  }
  EXPECT_NEAR(flux, 1, 1e-5);
}

TEST(SlabScene, WritesItsFilesAndTheSameBytesAgain) {
  const ScratchFolder a, b;
  SlabOptions options;
  EXPECT_EQ(write_slab(a.path(), options).size(), 2u);
  options.incidence = SlabOptions::Incidence::Diffuse;
  options.resolution = 4;
  const auto first = write_slab(a.path(), options), second = write_slab(b.path(), options);
  ASSERT_EQ(first.size(), 4u);
  EXPECT_EQ(first.front().filename(), "slab.json");
  for (std::size_t i = 0; i < first.size(); ++i)
    EXPECT_EQ(read_bytes(first[i]), read_bytes(second[i])) << first[i];
}

TEST(SlabScene, RefusesWhatIsOutOfRange) {
  const ScratchFolder folder;
  const auto refused = [&](auto change) {
    SlabOptions options;
    change(options);
    EXPECT_THROW(write_slab(folder.path(), options), Error);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused([](SlabOptions& o) { o.optical_depth = 0; });
  refused([&](SlabOptions& o) { o.optical_depth = nan; });
  refused([](SlabOptions& o) { o.albedo = 1.01; });
  refused([&](SlabOptions& o) { o.albedo = nan; });
  refused([](SlabOptions& o) { o.anisotropy = -1; });
  refused([](SlabOptions& o) { o.width = 0.5; });
  refused([](SlabOptions& o) { o.resolution = 1; });
  refused([](SlabOptions& o) { o.resolution = -2; });
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(FurnaceScene, LosesNoLight) {
  for (const double albedo : {0.0, 0.25, 1.0}) {
    FurnaceOptions options;
    options.block_albedo = albedo;
    options.anisotropy = 0.6;
    const Scene scene = load(options);
    const Material& block = scene.materials.at(0);
    EXPECT_NEAR(block.albedo.g + block.emission.g, 1, 1e-6);
    EXPECT_EQ(block.is_emissive(), albedo < 1);
    // The gather sees it.
    EXPECT_EQ(block.direct, albedo == 1);
    const Volume& medium = scene.volumes.at(0);
    EXPECT_EQ(medium.sigma_a, RgbD(0.0));
    EXPECT_NEAR(medium.sigma_s.g * 2, options.optical_depth, 1e-6);
    EXPECT_FLOAT_EQ(static_cast<float>(medium.phase.g()), 0.6f);
    EXPECT_EQ(std::get<EnvironmentLight>(scene.lights.at(0)).radiance, Rgb(1.0f));
    ASSERT_TRUE(scene.cameras.contains("inside"));
    EXPECT_GT(medium.density_at(scene.find_camera("inside").position), 0);
    EXPECT_EQ(medium.density_at(scene.find_camera("").position), 0);
  }
}

TEST(FurnaceScene, LumpsKeepTheMeanDepth) {
  FurnaceOptions options;
  options.resolution = 24;
  const Scene scene = load(options);
  const Volume& medium = scene.volumes.at(0);
  ASSERT_FALSE(medium.is_homogeneous());
  double sum = 0, least = kInfinity, most = 0;
  constexpr int kSteps = 20;
  for (int z = 0; z < kSteps; ++z)
    for (int y = 0; y < kSteps; ++y)
      for (int x = 0; x < kSteps; ++x) {
        const double d = medium.density_at(Vec3d(x, y, z) * (1.9 / kSteps) - Vec3d(0.9));
        sum += d;
        least = std::min(least, d);
        most = std::max(most, d);
      }
  EXPECT_NEAR(sum / (kSteps * kSteps * kSteps), 1, 0.1);
  EXPECT_LT(least, 0.4);
  EXPECT_GT(most, 1.6);
  EXPECT_NEAR(medium.sigma_t().g * 2, options.optical_depth, 1e-6);
  EXPECT_EQ(medium.sigma_a, RgbD(0.0));
}

TEST(FurnaceScene, IsTheSameBytesForAnyNumberOfThreads) {
  const ScratchFolder a, b;
  FurnaceOptions options;
  options.resolution = 12;
  options.threads = 1;
  const auto first = write_furnace(a.path(), options);
  options.threads = 3;
  const auto second = write_furnace(b.path(), options);
  ASSERT_EQ(first.size(), 3u);
  for (std::size_t i = 0; i < first.size(); ++i)
    EXPECT_EQ(read_bytes(first[i]), read_bytes(second[i])) << first[i];
  options.seed += 1;
  EXPECT_NE(read_bytes(write_furnace(a.path(), options)[2]), read_bytes(second[2]));
}

TEST(FurnaceScene, RefusesWhatIsOutOfRange) {
  const ScratchFolder folder;
  const auto refused = [&](auto change) {
    FurnaceOptions options;
    change(options);
    EXPECT_THROW(write_furnace(folder.path(), options), Error);
  };
  refused([](FurnaceOptions& o) { o.optical_depth = -1; });
  refused([](FurnaceOptions& o) { o.anisotropy = 1; });
  refused([](FurnaceOptions& o) { o.block_albedo = 1.5; });
  refused([](FurnaceOptions& o) { o.resolution = 2000; });
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

}  // namespace
}  // namespace brume
