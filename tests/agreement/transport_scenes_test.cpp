// The path tracer against answers that hold every order of scattering: slabs by doubling, and the
// furnace. Means lie within four of their standard errors of the answer and within 1 % of it.
#include "data_gen/transport_scenes.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "scene/scene_file.h"
#include "support/plane_slab.h"
#include "support/scratch_folder.h"
#include "support/sensor.h"

namespace brume {
namespace {

using test::expect_near;
using test::Measured;
using test::options_of;
using test::PlaneSlab;
using test::Sensor;
using test::SlabFluxes;

constexpr double kMostError = 0.0033, kClose = 0.01;
// What a slab's width may take, and the roundness of single precision.
constexpr double kFinite = 0.001;

struct Stage {
  explicit Stage(const std::filesystem::path& file) : scene(load_scene(file, {})), world(scene) {}
  Sensor see(const std::string& camera, int samples) const {
    Sensor sensor(scene.find_camera(camera));
    sensor.expose(world, options_of(Transport::Full, samples));
    return sensor;
  }
  Scene scene;
  World world;
};

struct SlabCase {
  double optical_depth, albedo, g;
  int resolution, samples;
};
class PathTracedSlab : public testing::TestWithParam<SlabCase> {
 protected:
  Stage stage(SlabOptions::Incidence incidence) const {
    const SlabCase& c = GetParam();
    SlabOptions options;
    options.optical_depth = c.optical_depth;
    options.albedo = c.albedo;
    options.anisotropy = c.g;
    options.resolution = c.resolution;
    options.incidence = incidence;
    return Stage(write_slab(folder_.path(), options).front());
  }
  PlaneSlab slab() const { return {GetParam().optical_depth, GetParam().albedo, GetParam().g}; }

 private:
  ScratchFolder folder_;
};

void expect_light(const Measured& measured, double expected) {
  expect_near(measured, RgbD(expected), kFinite, kMostError);
  EXPECT_NEAR(measured.mean.g, expected, kClose * expected);
}

TEST_P(PathTracedSlab, ReflectsAndTransmitsABeam) {
  const Stage stage = this->stage(SlabOptions::Incidence::Normal);
  const SlabFluxes truth = slab().normal();
  expect_light(stage.see("reflection", GetParam().samples).beauty(), truth.reflected);
  const Sensor below = stage.see("transmission", GetParam().samples);
  expect_light(below.beauty(), truth.transmitted);
  expect_near(below.layer(Layer::DiffuseDirect), RgbD(truth.unscattered), 1e-6);
}

TEST_P(PathTracedSlab, ReflectsAndTransmitsASky) {
  const Stage stage = this->stage(SlabOptions::Incidence::Diffuse);
  const SlabFluxes truth = slab().diffuse();
  expect_light(stage.see("reflection", GetParam().samples).beauty(), truth.reflected);
  expect_light(stage.see("transmission", GetParam().samples).beauty(), truth.transmitted);
}

// Reciprocity, and the medium seen by the eye.
TEST_P(PathTracedSlab, ShowsUnderASkyWhatItDoesToABeam) {
  const Stage stage = this->stage(SlabOptions::Incidence::Diffuse);
  const SlabFluxes truth = slab().normal();
  expect_light(stage.see("above", GetParam().samples).beauty(), truth.reflected);
  expect_light(stage.see("below", GetParam().samples).beauty(), truth.transmitted);
}

INSTANTIATE_TEST_SUITE_P(Media, PathTracedSlab,
                         testing::Values(SlabCase{0.2, 1, 0, 0, 1600},
                                         SlabCase{1, 0.9, -0.4, 0, 512},
                                         SlabCase{2, 0.9, 0.5, 5, 1600},
                                         SlabCase{4, 1, 0, 0, 1600}));

class PathTracedFurnace : public testing::TestWithParam<FurnaceOptions> {};

TEST_P(PathTracedFurnace, IsWhite) {
  const ScratchFolder folder;
  const Stage stage(write_furnace(folder.path(), GetParam()).front());
  for (const char* camera : {"", "inside"})
    expect_near(stage.see(camera, 256).beauty(), RgbD(1.0), 1e-5, kMostError);
}

INSTANTIATE_TEST_SUITE_P(Media, PathTracedFurnace,
                         testing::Values(FurnaceOptions{.optical_depth = 10},
                                         FurnaceOptions{.optical_depth = 6,
                                                        .anisotropy = 0.6,
                                                        .block_albedo = 0.8,
                                                        .resolution = 24}));

}  // namespace
}  // namespace brume
