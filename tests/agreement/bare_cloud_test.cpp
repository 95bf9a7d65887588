// A bright cloud without surfaces, which light leaves after many scatterings: the cached integrator
// against the path tracer.
#include <gtest/gtest.h>

#include <cstdlib>

#include "core/random.h"
#include "render/path_tracer.h"
#include "support/smoky_rooms.h"

namespace brume {
namespace {

// Lumps of about a mean free path, with edges sharp enough that cells of records hold dense and
// thin places alike.
Volume cloud() {
  struct Ball {
    Vec3d centre{0.0};
    double radius = 0;
  };
  std::vector<Ball> balls;
  RandomStream random(random_key(12));
  for (int i = 0; i < 40; ++i) {
    const Vec2d u = random.uniform2();
    const Vec3d at(u.x, u.y, random.uniform());
    balls.push_back({Vec3d(0.2) + at * 0.6, 0.06 + 0.12 * random.uniform()});
  }
  Volume v = test::haze(RgbD(14.25), RgbD(0.75), 0, test::kUnitBox);
  v.density = test::dense_grid(test::kUnitBox, 49, [&](const Vec3d& p) {
    double most = 0;
    for (const Ball& b : balls)
      most = std::max(most, std::clamp(4 * (1 - (p - b.centre).length() / b.radius), 0.0, 1.0));
    return most;
  });
  return v;
}

double mean_of(const PixelFilm& film) {
  double sum = 0;
  for (int y = 0; y < film.height(); ++y)
    for (int x = 0; x < film.width(); ++x) sum += luminance(film.at(x, y).beauty());
  return sum / film.width() / film.height();
}

TEST(BareCloud, IsAsBrightAsPathTracingSays) {
  Scene scene;
  scene.volumes = {cloud()};
  scene.lights.emplace_back(DirectionalLight{Vec3d(-0.6, -1, -0.4).normalized(), Rgb(3.0f)});
  Camera camera;
  camera.position = {2.2, 1.3, 2.4};
  camera.look_at = {0.5, 0.5, 0.5};
  camera.fov_deg = 24;
  BakeSettings settings = test::coarse_settings();
  settings.gather.cells_theta = 20;
  settings.gather.cells_phi = 64;
  const test::Stage stage(scene, settings);
  const BakeView view{"view", camera, 32, 32};
  const BakeResult baked = stage.bake(view);
  CachedRenderOptions options;
  options.samples = 64;
  options.threads = 2;
  options.scattered = baked.scattered;
  const double cached = mean_of(stage.render(*baked.cache, view, options));

  PathTracerOptions paths;
  paths.transport = Transport::Full;
  paths.samples = 1024;
  paths.threads = 2;
  PixelFilm traced(view.width, view.height);
  trace_paths(stage.world, CameraRays(camera, view.width, view.height), paths, traced);
  const double truth = mean_of(traced);
  if (std::getenv("BRUME_SHOW_AGREEMENT"))
    std::printf("cloud: %.5f for %.5f, %+.2f %%; %zu records\n", cached, truth,
                100 * (cached / truth - 1), baked.cache->volume()->size());
  EXPECT_NEAR(cached, truth, 0.015 * truth);
}

}  // namespace
}  // namespace brume
