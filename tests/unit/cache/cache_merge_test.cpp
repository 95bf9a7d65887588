#include "cache/cache_merge.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "sample_records.h"

namespace brume {
namespace {

using testing::HasSubstr;

// What a bake makes: three waves all shards share, and one that they divide.
struct Baked {
  std::vector<SurfaceRecord> shared, divided;

  std::vector<SurfaceRecord> whole() const {
    std::vector<SurfaceRecord> all = shared;
    all.insert(all.end(), divided.begin(), divided.end());
    return all;
  }
  MergeInput shard(std::uint32_t i, std::uint32_t n, std::uint64_t request = 7) const {
    MergeInput input{"shard" + std::to_string(i), {}};
    input.contents.header = sample_header();
    input.contents.header.shards = {request, n, {i}};
    input.contents.records = shared;
    for (std::size_t k = i; k < divided.size(); k += n) {
      input.contents.records.push_back(divided[k]);
      input.contents.records.back().flags |= kUnfinishedViewFlag;
    }
    return input;
  }
};

Baked bake() {
  Baked baked;
  for (const auto& [layer, wave] : {std::pair{0, 0}, {1, 0}, {2, 128}})
    for (const SurfaceRecord& r : sample_records(50, layer, wave)) baked.shared.push_back(r);
  baked.divided = sample_records(333, 2, 131);
  return baked;
}

TEST(CacheMerge, AllShardsInAnyOrderMakeTheWhole) {
  const Baked baked = bake();
  for (const std::uint32_t n : {1u, 2u, 5u}) {
    std::vector<MergeInput> inputs;
    for (std::uint32_t i = 0; i < n; ++i) inputs.push_back(baked.shard(i, n));
    std::vector<std::uint32_t> order(n);
    for (std::uint32_t i = 0; i < n; ++i) order[i] = i;
    do {
      std::vector<MergeInput> ordered;
      for (const std::uint32_t i : order) ordered.push_back(inputs[i]);
      const MergedCache merged = merge_caches(ordered);
      ASSERT_TRUE(same_bits(merged.records, baked.whole())) << n;
      ASSERT_EQ(merged.header.shards, ShardSet());
      ASSERT_EQ(merged.repeated, (n - 1) * baked.shared.size());
    } while (std::next_permutation(order.begin(), order.end()));
  }
}

TEST(CacheMerge, WithoutSomeShardsItSaysWhichAndStaysUnfinished) {
  const Baked baked = bake();
  const MergedCache some = merge_caches({baked.shard(3, 5), baked.shard(0, 5)});
  EXPECT_EQ(some.shards.missing(), (std::vector<std::uint32_t>{1, 2, 4}));
  EXPECT_EQ(some.header.shards, (ShardSet{7, 5, {0, 3}}));
  EXPECT_EQ(
      std::count_if(some.records.begin(), some.records.end(),
                    [](const SurfaceRecord& r) { return (r.flags & kUnfinishedViewFlag) != 0; }),
      67 + 66);
  // A merge of merges is one too.
  MergeInput first{"some", {}};
  first.contents.header = some.header;
  first.contents.records = some.records;
  const MergedCache all = merge_caches(
      {baked.shard(1, 5), first, baked.shard(4, 5), baked.shard(2, 5), baked.shard(3, 5)});
  EXPECT_TRUE(same_bits(all.records, baked.whole()));
}

TEST(CacheMerge, OneTaskDoneTwiceIsNoConflict) {
  const Baked baked = bake();
  const MergedCache merged =
      merge_caches({baked.shard(0, 2), baked.shard(1, 2), baked.shard(0, 2), baked.shard(1, 2)});
  EXPECT_TRUE(same_bits(merged.records, baked.whole()));
}

TEST(CacheMerge, EqualKeysWithDifferentBitsAreAnError) {
  const Baked baked = bake();
  for (const std::size_t wrong : {std::size_t(0), std::size_t(149)}) {
    MergeInput bad = baked.shard(1, 2);
    bad.contents.records[wrong].gradient[3] += 1e-6f;
    std::string message;
    EXPECT_EQ(kind_thrown(
                  [&] {
                    merge_caches({baked.shard(0, 2), bad});
                  },
                  &message),
              ErrorKind::InvalidInput);
    EXPECT_THAT(message, HasSubstr("shard0"));
    EXPECT_THAT(message, HasSubstr("shard1"));
    char key[20];
    std::snprintf(key, sizeof key, "%016llx",
                  static_cast<unsigned long long>(bad.contents.records[wrong].key));
    EXPECT_THAT(message, HasSubstr(key));
  }
}

TEST(CacheMerge, WhatDoesNotBelongTogetherIsRefused) {
  const Baked baked = bake();
  MergeInput other = baked.shard(1, 2);
  other.contents.header.fingerprint.words[1] ^= 1;
  std::string message;
  EXPECT_EQ(kind_thrown(
                [&] {
                  merge_caches({baked.shard(0, 2), other});
                },
                &message),
            ErrorKind::InvalidInput);
  EXPECT_THAT(message, HasSubstr("different scenes"));
  EXPECT_EQ(kind_thrown(
                [&] {
                  merge_caches({baked.shard(0, 2), baked.shard(1, 3)});
                },
                &message),
            ErrorKind::InvalidInput);
  EXPECT_THAT(message, HasSubstr("shards of 2 and of 3"));
  EXPECT_EQ(kind_thrown(
                [&] {
                  merge_caches({baked.shard(0, 2), baked.shard(1, 2, 8)});
                },
                &message),
            ErrorKind::InvalidInput);
  EXPECT_THAT(message, HasSubstr("other views"));
}

TEST(CacheMerge, CachesOfDifferentViewsAddUp) {
  MergeInput a{"a", {}}, b{"b", {}};
  a.contents.header = b.contents.header = sample_header();
  a.contents.records = sample_records(100, 1, 128, 1);
  b.contents.records = sample_records(100, 1, 128, 2);
  const MergedCache merged = merge_caches({a, b});
  EXPECT_EQ(merged.records.size(), 200u);
  EXPECT_TRUE(std::is_sorted(merged.records.begin(), merged.records.end(), RecordOrder{}));
}

}  // namespace
}  // namespace brume
