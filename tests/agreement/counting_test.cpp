// Bounces and scatterings are counted alike by the cached integrator and by the path tracer's cached
// transport: the mean light of each layer, where the two would differ by far more for one order more or
// less (SPEC, bounces and volume_bounces).
#include <gtest/gtest.h>

#include <cstdlib>

#include "plan/effects.h"
#include "render/path_tracer.h"
#include "support/smoky_rooms.h"

namespace brume {
namespace {

using test::Stage;

struct Limits {
  int bounces, volume_bounces;
};

class Counting : public testing::TestWithParam<Limits> {};

double mean_of(const PixelFilm& film, Layer layer) {
  double sum = 0;
  for (int y = 0; y < film.height(); ++y)
    for (int x = 0; x < film.width(); ++x) sum += luminance(film.at(x, y)[layer]);
  return sum / film.width() / film.height();
}

// Bright haze that glows a little, a lamp that gathers alone see, and walls: every kind of light is
// there to be counted.
Scene hazy_room() {
  Scene scene = test::blocks_in_a_room();
  test::add_lamps(scene);
  Volume haze = test::haze(RgbD(2.0), RgbD(0.4), 0, test::kUnitBox);
  haze.emission.mode = Emission::Mode::Density;
  haze.emission.scale = 0.1;
  scene.volumes.push_back(haze);
  return scene;
}

TEST_P(Counting, MeansOfEachLayerAgree) {
  constexpr int kSize = 24;
  const BakeView view = test::room_view(kSize, kSize);
  const CameraRays rays(view.camera, kSize, kSize);
  BakeSettings settings = test::coarse_settings(GetParam().bounces);
  settings.volume_bounces = GetParam().volume_bounces;
  const Stage stage(hazy_room(), settings);
  const BakeResult baked = stage.bake(view);
  CachedRenderOptions options;
  options.samples = 16;
  options.threads = 2;
  const PixelFilm cached = stage.render(*baked.cache, view, options);

  PathTracerOptions path;
  path.transport = Transport::Cached;
  path.bounces = settings.bounces;
  path.volume_bounces = settings.volume_bounces;
  path.samples = 512;
  path.threads = 2;
  PixelFilm traced(kSize, kSize);
  trace_paths(stage.world, rays, path, traced);

  const bool is_shown = std::getenv("BRUME_SHOW_AGREEMENT") != nullptr;
  if (is_shown)
    std::printf("%zu volume records, %llu volume gathers, solve %.2f s, bake %.2f s\n",
                baked.deep.volume_records,
                static_cast<unsigned long long>(baked.stats.counters.volume_gathers),
                baked.deep.seconds, baked.stats.seconds.empty() ? 0 : baked.stats.seconds[0].second);
  for (const Layer layer : {Layer::DiffuseIndirect, Layer::VolumeDirect, Layer::VolumeIndirect}) {
    const double c = mean_of(cached, layer), t = mean_of(traced, layer);
    if (is_shown)
      std::printf("%d bounces, %d scatterings, %s: %.5f cached, %.5f traced, %+.2f %%\n",
                  settings.bounces, settings.volume_bounces, layer_name(layer), c, t,
                  100 * (c / t - 1));
    EXPECT_NEAR(c, t, 0.025 * t) << layer_name(layer);
  }
}

INSTANTIATE_TEST_SUITE_P(Orders, Counting,
                         testing::Values(Limits{0, 2}, Limits{0, 3}, Limits{1, 1}, Limits{1, 2},
                                         Limits{2, 0}, Limits{2, 3}, Limits{3, 2},
                                         Limits{3, kEveryOrder}),
                         [](const auto& limits) {
                           const int v = limits.param.volume_bounces;
                           return "B" + std::to_string(limits.param.bounces) + "V" +
                                  (v == kEveryOrder ? "Any" : std::to_string(v));
                         });

}  // namespace
}  // namespace brume
