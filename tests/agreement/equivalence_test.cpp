// The cached integrator against the path tracer on the same paths (DESIGN 3): over 16x16-pixel
// blocks the 95 % interval of the mean relative difference lies within 2 %, its mean within 1 %,
// and the reference's own standard error is at most 0.5 %.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "agreement/blocks.h"
#include "render/path_tracer.h"
#include "scene/scene_file.h"
#include "support/smoky_rooms.h"

namespace brume {
namespace {

using test::Stage;

BakeSettings settings_of(int bounces) {
  BakeSettings s;
  s.gather.cells_theta = 16;
  s.gather.cells_phi = 50;
  s.bounces = bounces;
  s.error = 0.15;
  return s;
}

struct Statistics {
  double mean = 0, half_interval = 0;  // Of relative differences.
  double reference_error = 0;  // Standard error of the reference's mean over blocks, relative.
  int blocks = 0;
};

// Halves of the reference tell its noise.
Statistics compare(const PixelFilm& cached, const PixelFilm& a, const PixelFilm& b,
                   const Layer* layer, int channel) {
  const std::vector<RgbD> c = test::block_means(cached, layer), ra = test::block_means(a, layer),
                          rb = test::block_means(b, layer);
  double all = 0;
  for (std::size_t i = 0; i < c.size(); ++i) all += (ra[i][channel] + rb[i][channel]) / 2;
  all /= double(c.size());
  Statistics s;
  double sum = 0, squares = 0, noise = 0;
  for (std::size_t i = 0; i < c.size(); ++i) {
    const double reference = (ra[i][channel] + rb[i][channel]) / 2;
    if (!(reference > 0.05 * all)) continue;  // Too dark for a relative number.
    const double d = (c[i][channel] - reference) / reference;
    const double half = (ra[i][channel] - rb[i][channel]) / (2 * reference);
    sum += d;
    squares += d * d;
    noise += half * half;
    ++s.blocks;
  }
  if (s.blocks < 2) return s;
  s.mean = sum / s.blocks;
  const double variance =
      std::max(0.0, squares / s.blocks - s.mean * s.mean) * s.blocks / (s.blocks - 1);
  constexpr double kStudent95 = 2.15;  // 15 degrees of freedom, 16 blocks; larger than for more.
  s.half_interval = kStudent95 * std::sqrt(variance / s.blocks);
  s.reference_error = std::sqrt(noise) / s.blocks;
  return s;
}

// `layers` must all have light; beauty is compared besides.
void expect_equivalent(const Scene& scene, const Camera& camera, int bounces, int reference_samples,
                       const std::vector<Layer>& layers) {
  const Stage stage(scene, settings_of(bounces));
  const BakeView view{"view", camera, 64, 64};
  const BakeResult baked = stage.bake(view);
  CachedRenderOptions options;
  options.samples = 64;
  options.threads = 2;
  const PixelFilm cached = stage.render(*baked.cache, view, options);

  std::vector<PixelFilm> halves;
  for (const std::uint64_t seed : {101, 202}) {
    PathTracerOptions paths;
    paths.transport = Transport::Cached;
    paths.bounces = bounces;
    paths.seed = seed;
    paths.threads = 2;
    paths.samples = reference_samples / 2;
    halves.emplace_back(view.width, view.height);
    trace_paths(stage.world, CameraRays(camera, view.width, view.height), paths, halves.back());
  }

  std::vector<const Layer*> compared = {nullptr};
  for (const Layer& layer : layers) compared.push_back(&layer);
  for (const Layer* layer : compared)
    for (int channel = 0; channel < 3; ++channel) {
      const Statistics s = compare(cached, halves[0], halves[1], layer, channel);
      const std::string name =
          (layer ? layer_name(*layer) : "beauty") + std::string(1, "RGB"[channel]);
      SCOPED_TRACE(name + ": mean " + std::to_string(s.mean) + " +- " +
                   std::to_string(s.half_interval) + " over " + std::to_string(s.blocks) +
                   " blocks, reference " + std::to_string(s.reference_error));
      testing::Test::RecordProperty(name, std::to_string(s.mean));
      if (std::getenv("BRUME_SHOW_AGREEMENT"))
        std::printf("%s: mean %.4f +- %.4f over %d blocks, reference %.4f\n", name.c_str(), s.mean,
                    s.half_interval, s.blocks, s.reference_error);
      EXPECT_GE(s.blocks, 4);
      EXPECT_LE(std::abs(s.mean), 0.01);
      EXPECT_LE(std::abs(s.mean) + s.half_interval, 0.02);
      EXPECT_LE(s.reference_error, 0.005);
    }
}

TEST(Equivalence, SmokeAndHazeThatScatterForwards) {
  Scene scene = test::blocks_in_a_room();
  test::add_lamps(scene);
  scene.volumes = {test::smoke(RgbD(3.0), RgbD(1.0), 0.5),
                   test::haze(RgbD(0.25), RgbD(0.05), 0.2, test::kUnitBox)};
  expect_equivalent(scene, test::room_camera(), 2, 128,
                    {Layer::DiffuseDirect, Layer::DiffuseIndirect, Layer::VolumeDirect});
}

TEST(Equivalence, ExtinctionThatDiffersByColour) {
  Scene scene = test::blocks_in_a_room();
  test::add_lamps(scene);
  scene.volumes = {test::smoke(RgbD(1.0, 2.0, 4.0), RgbD(0.2, 0.5, 1.5), -0.3)};
  expect_equivalent(scene, test::room_camera(), 2, 128,
                    {Layer::DiffuseDirect, Layer::DiffuseIndirect, Layer::VolumeDirect});
}

TEST(Equivalence, MediaThatGlow) {
  Scene scene = test::blocks_in_a_room();
  Volume ember =
      test::smoke(RgbD(0.5), RgbD(1.5), 0, {Vec3d(0.3, 0.05, 0.5), Vec3d(0.7, 0.6, 0.9)});
  ember.emission.mode = Emission::Mode::Density;
  ember.emission.scale = 2;
  ember.emission.color = Rgb(1.0f, 0.6f, 0.3f);
  const Box3d corner{Vec3d(0.55, 0.35, 0.1), Vec3d(0.95, 0.8, 0.45)};
  Volume flame = test::smoke(RgbD(0.0), RgbD(2.0), 0, corner);
  flame.emission.mode = Emission::Mode::Blackbody;
  flame.emission.grid = {
      test::dense_grid(corner, 9, [&](const Vec3d& p) { return 2200 * test::lump(corner, p); })};
  // As bright as the other.
  flame.emission.scale = 3 / double(luminance(blackbody_radiance(2000)));
  scene.volumes = {ember, flame};
  expect_equivalent(scene, test::room_camera(), 2, 128,
                    {Layer::DiffuseIndirect, Layer::VolumeEmission});
}

TEST(Equivalence, CornellBoxOfSmoke) {
  const std::filesystem::path file =
      std::filesystem::path(BRUME_SHARED_DATA) / "scenes" / "cornell_smoke1.json";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no " << file.filename();
  const Scene scene = load_scene(file, {});
  expect_equivalent(scene, scene.find_camera(""), 2, 128,
                    {Layer::DiffuseDirect, Layer::DiffuseIndirect, Layer::VolumeDirect});
}

}  // namespace
}  // namespace brume
