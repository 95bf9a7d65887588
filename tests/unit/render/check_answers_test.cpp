// What checks a cache's answers finds nothing where they are true, and finds faults that were once
// there.
#include "render/check_answers.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "scene/scene_file.h"
#include "support/near_scenes.h"

namespace brume {
namespace {

using test::Stage;

BakeRequest request_of(const BakeView& view) {
  BakeRequest request;
  request.views = {view};
  return request;
}

// With as many paths as `settings` afford.
AnswerCheck check(const Stage& stage, const BakeSettings& settings, const IrradianceCache& cache,
                  const BakeRequest& request, int points = 64) {
  return summarise({check_answers(stage.lighting, settings, cache, request, points)},
                   cache.records(), cache.origin());
}

AnswerCheck check(const Stage& stage, const IrradianceCache& cache, const BakeRequest& request,
                  int points = 64) {
  return check(stage, stage.settings, cache, request, points);
}

// Records that reach as far as `radius` and ask for no ray: one of `step` is kept.
IrradianceCache with_reach(const IrradianceCache& cache, float radius, std::size_t step = 1) {
  std::vector<SurfaceRecord> records;
  for (std::size_t i = 0; i < cache.records().size(); i += step) {
    SurfaceRecord r = cache.records()[i];
    r.radius[0] = r.radius[1] = radius;
    r.flags |= kClearFlag;
    records.push_back(r);
  }
  return {std::move(records), cache.origin()};
}

TEST(AnswerCheck, FindsTrueAnswersTrue) {
  const Stage stage(test::smoky_room());
  const auto cache = stage.bake(test::room_view(24, 18)).cache;
  const AnswerCheck c = check(stage, *cache, request_of(test::room_view(24, 18)));
  EXPECT_EQ(c.points, 64);
  EXPECT_EQ(c.gathered, 0);
  EXPECT_GT(c.truth, 0);
  EXPECT_NEAR(c.bias, 0, 3 * c.bias_error);
  EXPECT_LT(c.bias_error, 0.03);
  EXPECT_LT(c.rmse_low, 0.06);
  EXPECT_FALSE(c.is_doubtful());
}

TEST(AnswerCheck, IsTheSameForAnyNumberOfThreadsAndParts) {
  const Stage stage(test::block_on_ground(10), test::far_settings(2));
  const auto cache = stage.bake(test::view_of_block()).cache;
  BakeRequest request = request_of(test::view_of_block());
  const auto checked = [&] {
    return check_answers(stage.lighting, stage.settings, *cache, request, 16);
  };
  request.threads = 1;
  const CheckedRequest one = checked();
  request.threads = 3;
  EXPECT_EQ(one, checked());
  // Shards measure the truth at their own points.
  CheckedRequests parts;
  request.shard.count = 3;
  for (request.shard.index = 0; request.shard.index < 3; ++request.shard.index) {
    const CheckedRequest part = checked();
    EXPECT_LE(summarise({part}, cache->records(), cache->origin()).points, 6);
    parts = united(parts, {part});
  }
  EXPECT_EQ(parts, CheckedRequests{one});
}

// A second frame asks records anew, and no paths.
TEST(AnswerCheck, TakesOverKnownTruthsOfTheSamePoints) {
  const Stage stage(test::block_on_ground(10), test::far_settings(2));
  const auto cache = stage.bake(test::view_of_block()).cache;
  const BakeRequest request = request_of(test::view_of_block());
  const auto checked = [&](int points, const CheckedRequest* known) {
    return check_answers(stage.lighting, stage.settings, *cache, request, points, nullptr, known);
  };
  const CheckedRequest traced = checked(16, nullptr);
  CheckedRequest known = traced;
  for (CheckedPoint& point : known.points) {
    point.truth.half[0] *= 2;
    point.keys.clear();
  }
  const CheckedRequest again = checked(16, &known);
  ASSERT_EQ(again.points.size(), 16u);
  for (std::size_t i = 0; i < 16; ++i) {
    EXPECT_EQ(again.points[i].truth, known.points[i].truth);
    EXPECT_EQ(again.points[i].keys, traced.points[i].keys);
  }
  EXPECT_EQ(checked(8, &known), checked(8, nullptr));
  known.points[3].truth = {};
  EXPECT_EQ(checked(16, &known), traced);
}

// What the file says is what the picture takes.
TEST(AnswerCheck, AnswersAreThoseOfPixelQueries) {
  const Stage stage(test::block_on_ground(10), test::far_settings(2));
  const auto cache = stage.bake(test::view_of_block()).cache;
  const BakeRequest request = request_of(test::view_of_block());
  const CheckedRequest checked = check_answers(stage.lighting, stage.settings, *cache, request, 32);
  for (const CheckedPoint& point : checked.points) {
    const AnswerCheck one =
        summarise({{checked.request, {point}}}, cache->records(), cache->origin());
    const InterpolatedIrradiance picture =
        cache->irradiance(pixel_query(stage.world, point.position, point.normal, point.footprint));
    EXPECT_EQ(one.answer, luminance(picture.irradiance));
    EXPECT_EQ(point.keys.size(), static_cast<std::size_t>(picture.records));
  }
}

TEST(AnswerCheck, DoubtsFewWideRecordsOnFarGround) {
  const Stage stage(test::block_on_ground(1000), test::far_settings(2));
  const auto cache = stage.bake(test::view_of_block()).cache;
  const BakeRequest request = request_of(test::view_of_block());
  EXPECT_FALSE(check(stage, *cache, request).is_doubtful());
  EXPECT_TRUE(check(stage, with_reach(*cache, 5, 100), request).is_doubtful());
}

TEST(AnswerCheck, DoubtsLightThatComesThroughWalls) {
  const Stage stage(test::two_rooms(0), test::far_settings(2));
  const auto lit = stage.bake(test::view_along(-1.6, -0.2)).cache;
  const BakeRequest dark = request_of(test::view_along(1.6, 0.2));
  const AnswerCheck right = check(stage, *lit, dark, 16);
  EXPECT_EQ(right.gathered, 16);
  EXPECT_EQ(right.truth, 0);
  EXPECT_EQ(right.answer, 0);
  EXPECT_FALSE(right.is_doubtful());
  const AnswerCheck leaking = check(stage, with_reach(*lit, 2), dark, 16);
  EXPECT_GT(leaking.bias, 0.99);
  EXPECT_TRUE(leaking.is_doubtful());
}

// Deep records as they were before radii followed what is near: at least so wide, whoever stands
// between, and none within another's reach.
IrradianceCache wide_deep_records(const IrradianceCache& cache, float radius) {
  std::vector<SurfaceRecord> kept;
  for (SurfaceRecord r : cache.records()) {
    if (r.layer() != kDeepLayer) continue;
    const auto covers = [&](const SurfaceRecord& k) {
      double apart = 0, turned = 0;
      for (int a = 0; a < 3; ++a) {
        apart += std::pow(double(k.position[a]) - r.position[a], 2);
        turned += double(k.normal[a]) * r.normal[a];
      }
      return std::sqrt(apart) < k.radius[0] && turned > 0.9;
    };
    if (std::any_of(kept.begin(), kept.end(), covers)) continue;
    for (float& own : r.radius) own = std::max(own, radius);
    r.flags |= kClearFlag;
    kept.push_back(r);
  }
  return {std::move(kept), cache.origin(), {}, cache.volume()};
}

// A real room of thin planks in haze, with the deep radii of version 9: at least 0.016 of the
// scene's diagonal.
TEST(AnswerCheck, DoubtsWideDeepRecordsAmongPlanks) {
  const auto file = std::filesystem::path(BRUME_SHARED_DATA) / "scenes" / "garage.json";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no " << file.filename();
  const Scene scene = load_scene(file, {});
  const Stage stage(scene, test::far_settings(4));
  BakeRequest request = request_of({"garage", scene.find_camera(""), 48, 36});
  request.threads = 2;
  const auto right = stage.bake(request).cache;
  BakeSettings usual = stage.settings;  // A bake of coarse cells affords few paths.
  usual.gather = {};
  EXPECT_FALSE(check(stage, usual, *right, request).is_doubtful());

  const auto old_radius = static_cast<float>(0.016 * stage.world.diagonal());
  const IrradianceCache wide = wide_deep_records(*right, old_radius);
  const AnswerCheck wrong = check(stage, usual, *stage.bake(request, &wide).cache, request);
  EXPECT_LT(wrong.bias, -0.06);
  EXPECT_TRUE(wrong.is_doubtful());
}

TEST(AskedPoints, AreSpreadOverPixelsOrAllSurfaces) {
  const Stage stage(test::two_rooms(0.2));
  BakeRequest views = request_of(test::view_along(-1.6, -0.2));
  views.views.push_back(test::view_along(1.8, 0.4));
  int left = 0;
  for (const AskedPoint& p : asked_points(stage.world, views, 100, 1)) {
    left += p.hit.position.x <= 1e-6;
    EXPECT_GT(p.footprint, 0);
    EXPECT_NEAR(p.normal.length(), 1, 1e-6);
  }
  EXPECT_EQ(left, 50);
  BakeRequest all;
  all.everywhere = true;
  double height = 0;
  const auto points = asked_points(stage.world, all, 400, 1);
  ASSERT_EQ(points.size(), 400u);
  for (const AskedPoint& p : points) {
    EXPECT_EQ(p.footprint, 0);
    height += p.hit.position.z / 400;
  }
  EXPECT_NEAR(height, 1, 0.1);
}

TEST(AskedPoints, AreNoneWhereNothingIsSeen) {
  Scene empty;
  empty.lights.emplace_back(PointLight{{0, 0, 1}, Rgb(1.0f)});
  const World world(empty);
  BakeRequest request = request_of(test::view_along(0, 1));
  EXPECT_TRUE(asked_points(world, request, 8, 1).empty());
  request.everywhere = true;
  EXPECT_TRUE(asked_points(world, request, 8, 1).empty());
}

}  // namespace
}  // namespace brume
