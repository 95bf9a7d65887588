// What is kept of a cache's check: texts, unions and what follows from them.
#include "cache/answer_check.h"

#include <gtest/gtest.h>

#include "sample_records.h"

namespace brume {
namespace {

CheckedPoint point_with(int stretches, std::vector<std::uint64_t> keys, int paths) {
  CheckedPoint p;
  p.position = {0.1, 1.0 / 3, 2};
  p.normal = {0, 0, 1};
  p.footprint = 0.25;
  p.stretches = stretches;
  p.keys = std::move(keys);
  if (paths > 0) {
    p.truth.paths = paths;
    p.truth.half[0] = 0.1 * paths;
    p.truth.half[1] = 0.2 * paths;
    p.truth.squares = 0.5 * paths;
  }
  return p;
}

TEST(AnswerCheck, ComesBackFromItsText) {
  CheckedPoint gathered = point_with(CheckedPoint::kNobody, {}, 16);
  gathered.gathered = 0.7;
  const CheckedRequests checked{{3, {point_with(0, {1, ~std::uint64_t(0)}, 32), gathered}},
                                {9, {point_with(2, {5}, 0)}}};
  EXPECT_EQ(read_checks(checks_text(checked)), checked);
  EXPECT_EQ(checks_text({}), "");
}

TEST(AnswerCheck, TakesOtherTextForNothing) {
  for (const char* text :
       {"", "{}", "[1]", "[{\"request\":1}]", "[{\"request\":1,\"points\":[{}]}]",
        "[{\"request\":-1,\"points\":[{\"position\":[1,2]}]}]", "\xff", "[[["})
    EXPECT_TRUE(read_checks(text).empty()) << text;
}

TEST(AnswerCheck, PartsUniteToWhatTheWholeSays) {
  const CheckedRequests near{{1, {point_with(0, {2, 4}, 0)}}};
  const CheckedRequests near_too{{1, {point_with(0, {3, 4}, 64)}}};
  const CheckedRequests far{{1, {point_with(1, {7, 8, 9}, 0)}}};
  const CheckedRequests none{{1, {point_with(CheckedPoint::kNobody, {}, 0)}}};
  const CheckedRequests whole{{1, {point_with(0, {2, 3, 4}, 64)}}};
  EXPECT_EQ(united(united(near, far), united(none, near_too)), whole);
  EXPECT_EQ(united(united(near_too, none), united(near, far)), whole);
  EXPECT_EQ(united(whole, whole), whole);
  const CheckedRequests other{{0, {point_with(0, {1}, 8)}}};
  EXPECT_EQ(united(whole, other), (CheckedRequests{other[0], whole[0]}));
}

TEST(AnswerCheck, CountsPointsWhoseRecordsAndTruthAreThere) {
  const std::vector<SurfaceRecord> records = sample_records(8, kTopLayer);
  CheckedPoint asked = point_with(0, {records[3].key}, 100);
  const Vec3d at(records[3].position[0], records[3].position[1], records[3].position[2]);
  asked.position = at + Vec3d(5.0);
  asked.normal = Vec3d(records[3].normal[0], records[3].normal[1], records[3].normal[2]);
  asked.footprint = 0;
  const double there =
      luminance(RgbD(records[3].irradiance[0], records[3].irradiance[1], records[3].irradiance[2]));
  asked.truth.half[0] = asked.truth.half[1] = 50 * there / 2;  // The truth is half the answer.
  asked.truth.squares = 100 * there * there / 4;
  const CheckedPoint gone = point_with(0, {12345}, 100),
                     unknown = point_with(0, {records[1].key}, 0);
  const AnswerCheck check = summarise({{1, {asked, gone, unknown}}}, records, Vec3d(5.0));
  EXPECT_EQ(check.points, 1);
  EXPECT_NEAR(check.answer, there, 1e-6 * there);
  EXPECT_NEAR(check.bias, 0.5, 1e-6);
  EXPECT_NEAR(check.rmse, 0.5, 1e-6);
  EXPECT_TRUE(check.is_doubtful());
  EXPECT_EQ(summarise({}, records, Vec3d(0.0)).points, 0);
}

}  // namespace
}  // namespace brume
