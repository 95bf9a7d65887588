// Frames of the cached renderer against closed forms, quadrature and themselves.
#include "render/cached_renderer.h"

#include <gtest/gtest.h>

#include <cstring>

#include "support/smoky_rooms.h"

namespace brume {
namespace {

using test::Stage;

constexpr Layer kAllLayers[] = {
    Layer::DiffuseDirect,  Layer::DiffuseIndirect, Layer::GlossyDirect,
    Layer::GlossyIndirect, Layer::VolumeDirect,    Layer::VolumeIndirect,
    Layer::VolumeEmission, Layer::Emission,        Layer::Background};

CachedRenderOptions options_of(int samples, int threads = 2) {
  CachedRenderOptions options;
  options.samples = samples;
  options.threads = threads;
  return options;
}

// Pixels that all look along one ray.
BakeView narrow_view(const Vec3d& position, const Vec3d& look_at, int pixels = 4) {
  BakeView view{"narrow", {}, pixels, pixels};
  view.camera.position = position;
  view.camera.look_at = look_at;
  const Vec3d d = look_at - position;
  view.camera.up = std::abs(d.y) > 0.9 * d.length() ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0);
  view.camera.fov_deg = 1e-5;
  return view;
}

RgbD mean_of(const PixelFilm& film, Layer layer) {
  RgbD sum;
  for (int y = 0; y < film.height(); ++y)
    for (int x = 0; x < film.width(); ++x) sum += film.at(x, y)[layer];
  return sum / double(film.width() * film.height());
}

void expect_near(const RgbD& value, const RgbD& expected, double relative) {
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(value[c], expected[c], relative * std::abs(expected[c]) + 1e-12) << "channel " << c;
}

bool same_pixel(const PixelResult& a, const PixelResult& b) {
  // Numbers only, so equal bits and nothing between them.
  static_assert(sizeof(PixelResult) % sizeof(double) == 0);
  return std::memcmp(&a, &b, sizeof a) == 0;
}

bool same_film(const PixelFilm& a, const PixelFilm& b) {
  for (int y = 0; y < a.height(); ++y)
    for (int x = 0; x < a.width(); ++x)
      if (!same_pixel(a.at(x, y), b.at(x, y))) return false;
  return true;
}

Scene floor_scene(float albedo) {
  Scene scene;
  test::add_rectangle(scene, {-50, -50, 0}, {100, 0, 0}, {0, 100, 0},
                      test::add_material(scene, test::diffuse(albedo)));
  return scene;
}

TEST(CachedRenderer, BeautyIsTheSumOfItsLayers) {
  Scene scene = test::smoky_room();
  scene.volumes[0].emission.mode = Emission::Mode::Density;
  scene.materials[1].specular = Rgb(0.2f);
  scene.materials[1].roughness = 0.5f;
  const Stage stage(scene);
  const BakeView view = test::room_view(32, 32);
  const BakeResult baked = stage.bake(view);
  const PixelFilm film = stage.render(*baked.cache, view, options_of(4));
  double light = 0;
  std::array<double, kLayerCount> by_layer{};
  for (int y = 0; y < 32; ++y)
    for (int x = 0; x < 32; ++x) {
      const PixelResult& p = film.at(x, y);
      RgbD sum;
      for (const Layer layer : kAllLayers) {
        ASSERT_TRUE(is_finite(p[layer])) << layer_name(layer);
        for (int c = 0; c < 3; ++c) ASSERT_GE(p[layer][c], 0) << layer_name(layer);
        sum += p[layer];
        by_layer[static_cast<std::size_t>(layer)] += luminance(p[layer]);
      }
      const RgbD beauty = p.beauty();
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(beauty[c], sum[c], 1e-12 * (1 + sum[c]));
      light += luminance(beauty);
    }
  EXPECT_GT(light, 0);
  for (const Layer layer : {Layer::DiffuseDirect, Layer::DiffuseIndirect, Layer::GlossyDirect,
                            Layer::GlossyIndirect, Layer::VolumeDirect, Layer::VolumeEmission})
    EXPECT_GT(by_layer[static_cast<std::size_t>(layer)], 0) << layer_name(layer);
}

class RenderedRoom : public testing::Test {
 protected:
  static const Stage& stage() {
    static const Stage stage(test::smoky_room());
    return stage;
  }
  static BakeView view() { return test::room_view(40, 28); }
  static const IrradianceCache& cache() {
    static const BakeResult baked = stage().bake(view());
    return *baked.cache;
  }
};

TEST_F(RenderedRoom, IsTheSameForAnyThreadCount) {
  const PixelFilm one = stage().render(cache(), view(), options_of(3, 1));
  for (const int threads : {2, 3, 7})
    EXPECT_TRUE(same_film(one, stage().render(cache(), view(), options_of(3, threads))))
        << threads << " threads";
}

TEST_F(RenderedRoom, CropShowsThePixelsOfTheWholeFrame) {
  const PixelFilm whole = stage().render(cache(), view(), options_of(2));
  CachedRenderOptions options = options_of(2);
  options.crop_x = {0.25, 0.75};
  options.crop_y = {0.5, 1};
  const PixelFilm part = stage().render(cache(), view(), options);
  for (int y = 0; y < 28; ++y)
    for (int x = 0; x < 40; ++x) {
      const bool inside = x >= 10 && x < 30 && y >= 14;
      if (inside) {
        ASSERT_TRUE(same_pixel(part.at(x, y), whole.at(x, y))) << x << ", " << y;
      } else {
        ASSERT_EQ(luminance(part.at(x, y).beauty()), 0) << x << ", " << y;
      }
    }
}

TEST_F(RenderedRoom, WithoutRecordsGathersAreCountedOrThereIsNoIndirectLight) {
  const BakeView small = test::room_view(6, 6);
  const IrradianceCache nothing;
  Counters counters;
  CachedRenderOptions options = options_of(1);
  const PixelFilm fallback = stage().render(nothing, small, options, &counters);
  EXPECT_GT(counters.fallback_gathers, 20u);
  EXPECT_EQ(counters.fallback_gathers, counters.cache_misses);
  EXPECT_GT(luminance(mean_of(fallback, Layer::DiffuseIndirect)), 0);
  options.gather_fallback = false;
  const PixelFilm without = stage().render(nothing, small, options, &counters);
  EXPECT_EQ(counters.fallback_gathers, 0u);
  EXPECT_EQ(luminance(mean_of(without, Layer::DiffuseIndirect)), 0);
  EXPECT_EQ(mean_of(without, Layer::DiffuseDirect), mean_of(fallback, Layer::DiffuseDirect));
}

TEST_F(RenderedRoom, CoveredViewsNeedNoFallback) {
  Counters counters;
  stage().render(cache(), view(), options_of(4), &counters);
  EXPECT_GT(counters.cache_queries, 0u);
  EXPECT_LT(counters.fallback_gathers, counters.cache_queries / 200);
}

TEST_F(RenderedRoom, StopsWhenAsked) {
  CachedRenderOptions options = options_of(1, 1);
  int asked = 0;
  options.stop_requested = [&] { return ++asked > 2; };
  PixelFilm film(40, 28);
  const BakeView v = view();
  EXPECT_TRUE(render_cached(stage().lighting, stage().settings, cache(),
                            CameraRays(v.camera, 40, 28), options, film)
                  .is_stopped);
  EXPECT_GT(luminance(film.at(0, 0).beauty()), 0);
  EXPECT_EQ(luminance(film.at(39, 27).beauty()), 0);
}

// A wall that glows for gathers only, over a floor: smooth, so interpolation costs little.
TEST(CachedRenderer, InterpolatesASmoothSceneToAPercent) {
  Scene scene;
  test::add_rectangle(scene, {-3, -3, 0}, {6, 0, 0}, {0, 6, 0},
                      test::add_material(scene, test::diffuse(0.8f)));
  test::add_rectangle(scene, {-2, 2, 3}, {4, 0, 0}, {0, -4, 0},
                      test::add_material(scene, test::gathered_emitter(2)));
  BakeSettings settings = test::coarse_settings(1);
  settings.gather.cells_theta = 40;
  settings.gather.cells_phi = 125;
  settings.error = 0.1;
  settings.max_radius = 0.25;
  const Stage stage(scene, settings);
  BakeView view{"floor", {}, 16, 16};
  view.camera = {{0, -1.5, 1.2}, {0, 0.5, 0}, {0, 0, 1}, 50};
  const BakeResult baked = stage.bake(view);
  CachedRenderOptions options = options_of(2);
  const PixelFilm interpolated = stage.render(*baked.cache, view, options);
  options.gather_everywhere = true;
  Counters counters;
  const PixelFilm gathered = stage.render(*baked.cache, view, options, &counters);
  EXPECT_EQ(counters.cache_queries, 0u);
  // Both are as noisy as one gather, 0.5 % or so; over 4x4 pixels the difference is
  // interpolation's.
  for (int block = 0; block < 16; ++block) {
    double e = 0, i = 0;
    for (int k = 0; k < 16; ++k) {
      const int x = 4 * (block % 4) + k % 4, y = 4 * (block / 4) + k / 4;
      e += luminance(gathered.at(x, y)[Layer::DiffuseIndirect]) / 16;
      i += luminance(interpolated.at(x, y)[Layer::DiffuseIndirect]) / 16;
    }
    EXPECT_NEAR(i, e, 0.01 * e) << "block " << block;
  }
  EXPECT_GT(luminance(mean_of(gathered, Layer::DiffuseIndirect)), 0);
}

TEST(CachedRenderer, AWhiteFloorUnderTheSunIsItsClosedForm) {
  Scene scene = floor_scene(0.75f);
  scene.lights.emplace_back(DirectionalLight{Vec3d(1, 0, -2), Rgb(3, 2, 1)});
  const Stage stage(scene, test::coarse_settings(0));
  const PixelFilm film = stage.render({}, narrow_view({0, 0, 2}, {0.3, 0.1, 0}), options_of(2));
  expect_near(mean_of(film, Layer::DiffuseDirect),
              RgbD(3, 2, 1) * (0.75 / kPi * 2 / std::sqrt(5.0)), 1e-6);
  EXPECT_EQ(film.at(0, 0).alpha, 1);
  EXPECT_EQ(film.at(0, 0).beauty(), film.at(0, 0)[Layer::DiffuseDirect]);
}

// exp(-tau) from the eye and from the sun, in each channel.
TEST(CachedRenderer, AnAbsorberDimsByItsOpticalDepth) {
  const auto film_of = [](bool absorbs) {
    Scene scene = floor_scene(0.5f);
    scene.lights.emplace_back(DirectionalLight{Vec3d(0, 0, -1), Rgb(1.0f)});
    if (absorbs)
      scene.volumes.push_back(
          test::haze(RgbD(0.0), RgbD(0.2, 0.7, 1.5), 0, {Vec3d(-9, -9, 0.5), Vec3d(9, 9, 1.25)}));
    const Stage stage(scene, test::coarse_settings(0));
    return stage.render({}, narrow_view({0, 0, 2}, {1.5, 0, 0}), options_of(2));
  };
  const PixelFilm clear = film_of(false), dim = film_of(true);
  const double eye = 0.75 / std::cos(std::atan2(1.5, 2.0)), sun = 0.75;
  const RgbD sigma(0.2, 0.7, 1.5);
  expect_near(dim.at(1, 1).transmittance, exp_neg(sigma * eye), 1e-7);
  expect_near(mean_of(dim, Layer::DiffuseDirect),
              mean_of(clear, Layer::DiffuseDirect) * exp_neg(sigma * (eye + sun)), 1e-7);
  EXPECT_EQ(luminance(mean_of(dim, Layer::VolumeDirect)), 0);
}

// int sigma_s exp(-sigma_t (t + d)) I / d^2 p dt along the ray, by the midpoint rule.
TEST(CachedRenderer, HazeAroundAPointLightIsItsQuadrature) {
  for (const double g : {0.0, 0.6}) {
    const RgbD sigma_s(0.5, 0.3, 0.1), sigma_a(0.1, 0.2, 0.3);
    const Vec3d lamp(0.2, 0.3, 1.4);
    Scene scene;
    scene.volumes.push_back(test::haze(sigma_s, sigma_a, g, {Vec3d(-2), Vec3d(2, 2, 3)}));
    scene.lights.emplace_back(PointLight{lamp, Rgb(5.0f)});
    const Stage stage(scene, test::coarse_settings(0));
    const PixelFilm film = stage.render({}, narrow_view({0, 0, -4}, {0, 0, 0}, 16), options_of(64));

    const HenyeyGreenstein phase(static_cast<float>(g));
    RgbD expected;
    constexpr int kSteps = 100'000;
    const double h = 5.0 / kSteps;
    const RgbD sigma_t = sigma_s + sigma_a;
    for (int i = 0; i < kSteps; ++i) {
      const double s = (i + 0.5) * h;  // From the near face at z = -2.
      const Vec3d p(0, 0, -2 + s), to = lamp - p;
      const double d = to.length();
      expected += sigma_s * exp_neg(sigma_t * (s + d)) *
                  (5 / (d * d) * h * phase.eval(to / -d, Vec3d(0, 0, -1)));
    }
    expect_near(mean_of(film, Layer::VolumeDirect), expected, 0.005);
    // Where nothing is behind, alpha is what the haze takes.
    expect_near(film.at(3, 3).transmittance, exp_neg(sigma_t * 5), 1e-7);
    EXPECT_NEAR(film.at(3, 3).alpha, 1 - mean_component(exp_neg(sigma_t * 5)), 1e-7);
  }
}

// A slab of source term sigma_t * scale: L = scale (1 - exp(-tau)).
TEST(CachedRenderer, AGlowingSlabIsItsClosedForm) {
  Scene scene;
  Volume slab = test::haze(RgbD(0.0), RgbD(0.4, 1.0, 2.5), 0, {Vec3d(-9, -9, 0), Vec3d(9, 9, 1.2)});
  slab.emission.mode = Emission::Mode::Density;
  slab.emission.scale = 3;
  slab.emission.color = Rgb(1.0f, 0.5f, 0.25f);
  scene.volumes.push_back(slab);
  const Stage stage(scene, test::coarse_settings(0));
  const PixelFilm film = stage.render({}, narrow_view({0, 0, 5}, {0, 0, 0}), options_of(2));
  const RgbD t = exp_neg(RgbD(0.4, 1.0, 2.5) * 1.2);
  expect_near(mean_of(film, Layer::VolumeEmission),
              RgbD(3 * (1 - t.r), 1.5 * (1 - t.g), 0.75 * (1 - t.b)), 1e-6);
}

TEST(CachedRenderer, AnEmptySceneIsItsBackground) {
  Scene scene;
  EnvironmentLight sky;
  sky.radiance = Rgb(0.25f, 0.5f, 1.0f);
  scene.lights.emplace_back(sky);
  const Stage stage(scene);
  const BakeView view = test::room_view(8, 8);
  const BakeResult baked = stage.bake(view);
  EXPECT_EQ(baked.cache->records().size(), 0u);
  const PixelFilm film = stage.render(*baked.cache, view, options_of(2));
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 8; ++x) {
      expect_near(film.at(x, y)[Layer::Background], RgbD(0.25, 0.5, 1), 1e-6);
      EXPECT_EQ(film.at(x, y).beauty(), film.at(x, y)[Layer::Background]);
      EXPECT_EQ(film.at(x, y).alpha, 0);
      EXPECT_EQ(film.at(x, y).z, kInfinity);
    }
}

}  // namespace
}  // namespace brume
