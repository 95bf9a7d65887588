// Records follow what is near: far ground, stray triangles and units change nothing, and what lies
// behind a wall is never an answer.
#include <gtest/gtest.h>

#include "support/near_scenes.h"

namespace brume {
namespace {

using test::block_on_ground;
using test::far_settings;
using test::Stage;
using test::two_rooms;
using test::view_along;
using test::view_of_block;

double mean_indirect(const PixelFilm& film) {
  double sum = 0;
  for (int y = 0; y < film.height(); ++y)
    for (int x = 0; x < film.width(); ++x) sum += luminance(film.at(x, y)[Layer::DiffuseIndirect]);
  return sum / (film.width() * film.height());
}

struct Picture {
  std::size_t records;
  double indirect;
};
Picture picture_of(const Scene& scene, int bounces) {
  const Stage stage(scene, far_settings(bounces));
  const BakeResult baked = stage.bake(view_of_block());
  CachedRenderOptions options;
  options.samples = 4;
  options.threads = 2;
  return {baked.cache->records().size(),
          mean_indirect(stage.render(*baked.cache, view_of_block(), options))};
}

TEST(Near, FarGroundAndStrayTrianglesChangeNothing) {
  for (const int bounces : {1, 2}) {
    const Picture near = picture_of(block_on_ground(10), bounces);
    Scene stray = block_on_ground(10);
    test::add_rectangle(stray, {5000, 0, 3}, {1, 0, 0}, {0, 1, 0}, 0);
    for (const Scene& scene : {block_on_ground(1e3), block_on_ground(1e5), stray}) {
      const Picture other = picture_of(scene, bounces);
      EXPECT_NEAR(other.indirect, near.indirect, 0.02 * near.indirect) << bounces << " bounces";
      EXPECT_NEAR(double(other.records), double(near.records), 0.2 * double(near.records))
          << bounces << " bounces";
    }
  }
}

// The same room in units of two metres: what is stored differs by powers of two alone.
TEST(Near, AnotherUnitGivesTheSameRecords) {
  const auto in_unit = [](double unit) {
    Scene scene = block_on_ground(10);
    scene.unit = unit;
    for (TriangleMesh& mesh : scene.meshes)
      for (Vec3d& p : mesh.positions) p /= unit;
    std::get<PointLight>(scene.lights[0]).position /= unit;
    return scene;
  };
  BakeView view = view_of_block();
  const Stage metres(in_unit(1), far_settings(2));
  const BakeResult a = metres.bake(view);
  view.camera.position /= 2;
  view.camera.look_at /= 2;
  const Stage doubled(in_unit(2), far_settings(2));
  const BakeResult b = doubled.bake(view);
  ASSERT_EQ(a.cache->records().size(), b.cache->records().size());
  for (std::size_t i = 0; i < a.cache->records().size(); ++i) {
    const SurfaceRecord &r = a.cache->records()[i], &s = b.cache->records()[i];
    ASSERT_EQ(r.key, s.key);
    ASSERT_EQ(r.flags, s.flags);
    ASSERT_EQ(r.radius[0], 2 * s.radius[0]);
    for (int k = 0; k < 3; ++k) {
      ASSERT_EQ(r.position[k], 2 * s.position[k]);
      ASSERT_EQ(r.irradiance[k], s.irradiance[k]);
    }
    for (int k = 0; k < 9; ++k) ASSERT_EQ(2 * r.gradient[k], s.gradient[k]);
  }
}

// Within a honeycomb, haze scatters next to nothing.
TEST(Near, HazeInAClutterTakesFewRecords) {
  const auto records = [](bool has_clutter) {
    Scene scene;
    const auto white = test::add_material(scene, test::diffuse(0.6f));
    test::add_room(scene, test::kUnitBox, white);
    for (int i = 0; has_clutter && i <= 8; ++i) {
      const double at = 0.0125 * i;
      test::add_rectangle(scene, {0.3 + at, 0.4, 0.3}, {0, 0.1, 0}, {0, 0, 0.1}, white);
      test::add_rectangle(scene, {0.3, 0.4 + at, 0.3}, {0.1, 0, 0}, {0, 0, 0.1}, white);
      test::add_rectangle(scene, {0.3, 0.4, 0.3 + at}, {0.1, 0, 0}, {0, 0.1, 0}, white);
    }
    scene.lights.emplace_back(PointLight{{0.8, 0.6, 0.9}, Rgb(1.0f)});
    scene.volumes.push_back(test::haze(RgbD(0.1), RgbD(0.0), 0, test::kUnitBox));
    BakeSettings settings = test::coarse_settings(1);
    settings.volume_bounces = 3;
    const Stage stage(scene, settings);
    BakeRequest request;
    request.views = {test::room_view(8, 8)};
    request.deep_only = true;
    request.threads = 2;
    return stage.bake(request).cache->volume()->size();
  };
  EXPECT_LT(double(records(true)), 1.5 * double(records(false)));
}

// No surface sees another, and no lamp has a place: the medium alone asks what the ground reflects.
TEST(Near, GroundThatOnlyHazeSeesHasDeepRecords) {
  Scene scene;
  test::add_rectangle(scene, {-5, -5, 0}, {10, 0, 0}, {0, 10, 0},
                      test::add_material(scene, test::diffuse(0.6f)));
  scene.lights.emplace_back(DirectionalLight{{0, 0.2, -1}, Rgb(3.0f)});
  scene.volumes.push_back(test::haze(RgbD(1.0), RgbD(0.1), 0, Box3d({-2, -2, 0.1}, {2, 2, 1})));
  BakeSettings settings = test::coarse_settings(2);
  settings.volume_bounces = 3;
  const Stage stage(scene, settings);
  BakeRequest request;
  request.views = {view_of_block()};
  request.deep_only = true;
  request.threads = 2;
  EXPECT_GT(stage.bake(request).cache->records().size(), 100u);
}

class TwoRooms : public testing::TestWithParam<double> {};

TEST_P(TwoRooms, NoLightComesThroughTheWall) {
  const double wall = GetParam();
  const Stage stage(two_rooms(wall), far_settings(3));
  const BakeView lit = view_along(-1.6, -0.2), dark = view_along(wall + 1.6, wall + 0.2);
  CachedRenderOptions options;
  options.samples = 2;
  options.threads = 2;
  const auto brightest = [&](const IrradianceCache& cache, Counters* counters) {
    const PixelFilm film = stage.render(cache, dark, options, counters);
    double most = 0;
    for (int y = 0; y < film.height(); ++y)
      for (int x = 0; x < film.width(); ++x)
        most = std::max(most, luminance(film.at(x, y)[Layer::DiffuseIndirect]));
    return most;
  };
  const BakeResult of_lit = stage.bake(lit);
  EXPECT_GT(mean_indirect(stage.render(*of_lit.cache, lit, options)), 0.1);
  Counters counters;
  EXPECT_EQ(brightest(*of_lit.cache, &counters), 0);
  EXPECT_EQ(counters.fallback_gathers, std::uint64_t(dark.width * dark.height * options.samples));
  EXPECT_EQ(brightest(*stage.bake(dark).cache, nullptr), 0);
  EXPECT_EQ(brightest(*stage.bake(dark, of_lit.cache.get()).cache, nullptr), 0);
}

INSTANTIATE_TEST_SUITE_P(Walls, TwoRooms, testing::Values(0.0, 0.02, 0.2));

}  // namespace
}  // namespace brume
