// Parts of caches, and how two caches differ, where the answer is known.
#include "cache/record_filter.h"

#include <gtest/gtest.h>

#include "cache/cache_copy.h"
#include "cache/cache_difference.h"
#include "core/error.h"
#include "sample_records.h"

namespace brume {
namespace {

// Layers 0 to 2 of 50 records each.
CacheContents three_layers() {
  CacheContents contents;
  contents.header = sample_header();
  for (int layer = 0; layer < 3; ++layer)
    for (const SurfaceRecord& record : sample_records(50, layer))
      contents.records.push_back(record);
  contents.batch_ends = standard_batch_ends(contents.records);
  return contents;
}

std::size_t count_of(const CacheContents& contents, int layer) {
  return static_cast<std::size_t>(
      std::count_if(contents.records.begin(), contents.records.end(),
                    [&](const SurfaceRecord& r) { return r.layer() == layer; }));
}

TEST(RecordFilter, LeavesDeeperLayersWholeUnlessAsked) {
  RecordFilter filter;
  filter.radius = NumberRange{0.15, 1};
  const FilteredCache part = filter_records(three_layers(), filter);
  EXPECT_EQ(count_of(part.contents, 0), 50u);
  EXPECT_EQ(count_of(part.contents, 1), 50u);
  EXPECT_GT(count_of(part.contents, 2), 0u);
  EXPECT_EQ(part.dropped, 50u - count_of(part.contents, 2));
  EXPECT_TRUE(part.is_part);
  EXPECT_FALSE(part.lacks_deeper_layers);
  EXPECT_EQ(part.contents.header.fingerprint, sample_header().fingerprint);
  for (const SurfaceRecord& r : part.contents.records) {
    EXPECT_EQ((r.flags & kUnfinishedViewFlag) != 0, r.layer() == 2);
    EXPECT_TRUE(r.layer() < 2 || record_radius(r) >= 0.15);
  }
}

TEST(RecordFilter, ANewFingerprintTellsOfHolesBelow) {
  RecordFilter filter;
  filter.layers = IntegerRange{1, 2};
  FilteredCache part = filter_records(three_layers(), filter);
  EXPECT_TRUE(part.lacks_deeper_layers) << "layer 0 is gone";
  EXPECT_NE(part.contents.header.fingerprint, sample_header().fingerprint);

  filter.layers = IntegerRange{0, 1};
  part = filter_records(three_layers(), filter);
  EXPECT_FALSE(part.lacks_deeper_layers) << "what is left is whole";
  EXPECT_EQ(part.contents.header.fingerprint, sample_header().fingerprint);

  filter.radius = NumberRange{0.15, 1};
  part = filter_records(three_layers(), filter);
  EXPECT_TRUE(part.lacks_deeper_layers) << "layers 0 and 1 have holes";

  CacheContents deep = three_layers();
  std::erase_if(deep.records, [](const SurfaceRecord& r) { return r.layer() == 2; });
  RecordFilter holes;
  holes.top_layer = 2;
  holes.layers = IntegerRange{0, 1};
  holes.radius = NumberRange{0.15, 1};
  EXPECT_TRUE(filter_records(deep, holes).lacks_deeper_layers) << "the highest is not the top one";
}

TEST(RecordFilter, BadRecordsAlwaysGo) {
  CacheContents contents = three_layers();
  contents.records[120].radius[0] = -1;
  contents.records[130].irradiance[2] = std::numeric_limits<float>::quiet_NaN();
  FilteredCache part = filter_records(contents, {});
  EXPECT_EQ(part.dropped, 2u);
  EXPECT_FALSE(part.lacks_deeper_layers);
  contents.records[3].error = -1;
  part = filter_records(contents, {});
  EXPECT_EQ(part.dropped, 3u);
  EXPECT_TRUE(part.lacks_deeper_layers);
  const ScratchFolder folder;
  write_cache_contents(folder / "a.irc", part.contents);
  EXPECT_EQ(open_cache(folder / "a.irc", std::nullopt).state, CacheState::Loaded);
  EXPECT_THROW(write_cache_contents(folder / "b.irc", contents), Error);
}

TEST(RecordFilter, TheBoxIsInWorldSpace) {
  RecordFilter filter;
  const Vec3d origin = sample_header().origin;
  filter.box = Box3d(origin, origin + Vec3d(0.5, 1, 1));
  for (const SurfaceRecord& r : filter_records(three_layers(), filter).contents.records)
    EXPECT_TRUE(r.layer() < 2 || r.position[0] <= 0.5f);
}

TEST(CacheDifference, CountsRecordsByKeyAndMeasuresTheirLight) {
  CacheContents a = three_layers(), b = three_layers();
  a.records.pop_back();
  b.records.erase(b.records.begin());
  for (SurfaceRecord& r : a.records)
    if (r.layer() == 1)
      for (float& e : r.irradiance) e *= 1.5f;
  a.records[0].flags |= kUnfinishedViewFlag;
  a.records[10].flags |= kUnfinishedViewFlag;
  const CacheDifference d = compare_caches(a, b);
  EXPECT_EQ(d.only_a, 1u);
  EXPECT_EQ(d.only_b, 1u);
  EXPECT_EQ(d.different, 50u);
  EXPECT_EQ(d.equal, 98u) << "a flag of the bake is no difference";
  ASSERT_TRUE(d.values);
  EXPECT_NEAR(d.values->signed_mean, 0.5 * 50 / 148, 0.02);
  EXPECT_NEAR(d.values->max, 0.5 * 2 / 1.5, 0.1);
  EXPECT_EQ(d.values->gradient_rmse, 0);
  EXPECT_EQ(d.values->radius_rmse, 0);
}

TEST(CacheDifference, MeasuresGradientsAndRadii) {
  CacheContents a = three_layers();
  const CacheContents b = three_layers();
  for (SurfaceRecord& r : a.records) {
    for (float& g : r.gradient) g *= 1.25f;
    for (float& radius : r.radius) radius *= 2;
  }
  const CacheDifference d = compare_caches(a, b);
  EXPECT_NEAR(d.values->gradient_rmse, 0.25, 1e-6);
  EXPECT_NEAR(d.values->radius_rmse, std::log(2.0), 1e-6);
  EXPECT_EQ(d.values->rmse, 0);
}

TEST(CacheDifference, OfStrangersThereAreNoValues) {
  CacheContents a = three_layers();
  for (SurfaceRecord& r : a.records) r.key ^= 1ull << 63;
  std::sort(a.records.begin(), a.records.end(), RecordOrder{});
  const CacheDifference d = compare_caches(a, three_layers());
  EXPECT_FALSE(d.values);
  EXPECT_EQ(d.only_a, 150u);
  EXPECT_EQ(d.answers.uncovered, 0u) << "but they answer at the same places";
  EXPECT_GT(d.answers.points, 0u);
}

}  // namespace
}  // namespace brume
