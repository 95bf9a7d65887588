// Where nothing is interpolated the two integrators have the same mean: Welch's test for each block
// and layer over independent seeds, at a level of 1e-4 shared by all tests of a scene (Sidak).
#include <gtest/gtest.h>

#include <cstdlib>

#include "agreement/blocks.h"
#include "render/path_tracer.h"
#include "support/smoky_rooms.h"

namespace brume {
namespace {

using test::Stage;

constexpr int kSeeds = 12, kSize = 32;
constexpr double kLevel = 1e-4;

// Two-sided p of Student's t, by Simpson's rule over the angle atan(t / sqrt(n)), where the density
// is a power of a cosine.
double student_p(double t, double degrees) {
  constexpr int kSteps = 2000;
  const auto integral = [&](double from) {
    const double h = (kPi / 2 - from) / kSteps;
    double sum = 0;
    for (int i = 0; i <= kSteps; ++i)
      sum += (i == 0 || i == kSteps ? 1
              : i % 2               ? 4
                                    : 2) *
             std::pow(std::max(0.0, std::cos(from + i * h)), degrees - 1);
    return sum * h / 3;
  };
  return integral(std::atan(std::abs(t) / std::sqrt(degrees))) / integral(0);
}

struct Moments {
  double mean = 0, variance_of_mean = 0;
};

Moments moments(const std::vector<double>& x) {
  Moments m;
  for (const double v : x) m.mean += v / double(x.size());
  double squares = 0;
  for (const double v : x) squares += (v - m.mean) * (v - m.mean);
  m.variance_of_mean = squares / double(x.size() - 1) / double(x.size());
  return m;
}

double welch_p(const std::vector<double>& a, const std::vector<double>& b) {
  const Moments ma = moments(a), mb = moments(b);
  const double variance = ma.variance_of_mean + mb.variance_of_mean;
  // Without noise, rounding is all that may differ.
  if (!(variance > 0)) return std::abs(ma.mean - mb.mean) <= 1e-9 * std::abs(ma.mean) ? 1 : 0;
  const double degrees = variance * variance /
                         (ma.variance_of_mean * ma.variance_of_mean / double(a.size() - 1) +
                          mb.variance_of_mean * mb.variance_of_mean / double(b.size() - 1));
  return student_p((ma.mean - mb.mean) / std::sqrt(variance), degrees);
}

TEST(Welch, KnowsStudentsTable) {
  EXPECT_NEAR(student_p(2.131, 15), 0.05, 2e-4);
  EXPECT_NEAR(student_p(4.073, 15), 0.001, 1e-5);
  EXPECT_NEAR(student_p(12.706, 1), 0.05, 1e-4);
}

void expect_same_means(const Scene& scene, const Camera& camera, int path_samples,
                       const std::vector<Layer>& layers) {
  const BakeView view{"view", camera, kSize, kSize};
  const CameraRays rays(camera, kSize, kSize);
  std::vector<PixelFilm> cached, traced;
  BakeSettings settings = test::coarse_settings(1);
  settings.light_depth = LightDepth::Exact;
  Stage stage(scene, settings);
  BakeRequest request;
  request.threads = 2;
  request.deep_only = true;
  for (int i = 0; i < kSeeds; ++i) {
    stage.settings.seed = 1000 + i;
    const BakeResult deeper = bake(stage.lighting, stage.settings, request, nullptr);
    CachedRenderOptions options;
    options.samples = 2;
    options.threads = 2;
    options.gather_everywhere = true;
    cached.push_back(stage.render(*deeper.cache, view, options));
    PathTracerOptions paths;
    paths.transport = Transport::Cached;
    paths.bounces = 1;
    paths.volume_bounces = settings.volume_bounces;
    paths.samples = path_samples;
    paths.seed = 5000 + i;
    paths.threads = 2;
    traced.emplace_back(kSize, kSize);
    trace_paths(stage.world, rays, paths, traced.back());
  }

  const std::size_t blocks = test::block_means(cached[0], nullptr).size();
  const double tests = double(blocks * layers.size());
  const double level = -std::expm1(std::log1p(-kLevel) / tests);
  for (const Layer& layer : layers)
    for (std::size_t block = 0; block < blocks; ++block) {
      std::vector<double> a, b;
      for (int i = 0; i < kSeeds; ++i) {
        a.push_back(luminance(test::block_means(cached[i], &layer)[block]));
        b.push_back(luminance(test::block_means(traced[i], &layer)[block]));
      }
      const double p = welch_p(a, b);
      const Moments ma = moments(a), mb = moments(b);
      EXPECT_GT(ma.mean, 0) << layer_name(layer) << " block " << block;
      EXPECT_GT(p, level) << layer_name(layer) << " block " << block << ": " << ma.mean << " +- "
                          << std::sqrt(ma.variance_of_mean) << " against " << mb.mean << " +- "
                          << std::sqrt(mb.variance_of_mean);
      if (std::getenv("BRUME_SHOW_AGREEMENT"))
        std::printf("%s block %zu: %.5f +- %.5f against %.5f +- %.5f, p %.3g\n", layer_name(layer),
                    block, ma.mean, std::sqrt(ma.variance_of_mean), mb.mean,
                    std::sqrt(mb.variance_of_mean), p);
    }
}

// No deeper layer: the one bounce reflects direct light.
TEST(Welch, ClearRoom) {
  Scene scene = test::blocks_in_a_room();
  test::add_lamps(scene);
  expect_same_means(scene, test::room_camera(), 64, {Layer::DiffuseDirect, Layer::DiffuseIndirect});
}

// Walls are black, so that what the floor gathers is the medium's light alone and no record is
// asked.
TEST(Welch, SmokeOverAFloor) {
  Scene scene;
  test::add_rectangle(scene, {-1, 0, -1}, {0, 0, 3}, {3, 0, 0},
                      test::add_material(scene, test::diffuse(0.7f)));
  test::add_room(scene, {Vec3d(0.1, 0.3, 0.3), Vec3d(0.3, 0.7, 0.5)},
                 test::add_material(scene, test::diffuse(0)));
  test::add_lamps(scene);
  Volume smoke = test::smoke(RgbD(2.0, 3.0, 4.0), RgbD(1.0), 0.5);
  smoke.emission.mode = Emission::Mode::Density;
  smoke.emission.scale = 0.1;
  scene.volumes = {smoke, test::haze(RgbD(0.3), RgbD(0.1), -0.2, test::kUnitBox)};
  Camera camera = test::room_camera();
  camera.position = {0.5, 0.9, 1.6};
  camera.look_at = {0.5, 0.2, 0.5};
  camera.fov_deg = 40;
  expect_same_means(
      scene, camera, 96,
      {Layer::DiffuseDirect, Layer::DiffuseIndirect, Layer::VolumeDirect, Layer::VolumeEmission});
}

}  // namespace
}  // namespace brume
