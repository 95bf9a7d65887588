// The parent believes nothing that the child says.
#include "grid_blob.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>

#include "child_process.h"
#include "core/random.h"

namespace brume {
namespace {

BrickArrays small_channel() {
  BrickArrays a;
  a.brick_min = Vec3i(-1, 0, 2);
  a.brick_count = Vec3i(3, 1, 1);
  a.top = {0, BrickGrid::kEmpty, -2};
  a.bricks.assign(BrickGrid::kBrickFloats, 0.5f);
  a.tiles = {2.0f};
  a.index_to_world.m[0][0] = 3;
  return a;
}

LoadedList small_list() {
  LoadedArrays grid;
  grid.name = "density";
  grid.channels = {small_channel()};
  grid.bad_voxels = {1, 2, 3};
  grid.warnings = {"one", "two"};
  return {std::nullopt, grid};
}

std::vector<char> bytes_of(const LoaderResult& result) {
  const UniqueFd fd = make_memory_file("test");
  write_trail(fd.get(), "f.vdb");
  write_result(fd.get(), result);
  std::vector<char> bytes(std::size_t(::lseek(fd.get(), 0, SEEK_END)));
  EXPECT_EQ(::pread(fd.get(), bytes.data(), bytes.size(), 0), ssize_t(bytes.size()));
  return bytes;
}

TEST(GridBlob, GivesBackWhatWasWritten) {
  const auto result = parse_result(bytes_of(small_list()));
  const auto& list = std::get<LoadedList>(result);
  ASSERT_EQ(list.size(), 2u);
  EXPECT_FALSE(list[0].has_value());
  const LoadedArrays& g = *list[1];
  EXPECT_EQ(g.name, "density");
  EXPECT_EQ(g.bad_voxels.total(), 6u);
  EXPECT_EQ(g.warnings, (std::vector<std::string>{"one", "two"}));
  ASSERT_EQ(g.channels.size(), 1u);
  EXPECT_EQ(g.channels[0].top, small_channel().top);
  EXPECT_EQ(g.channels[0].bricks, small_channel().bricks);
  EXPECT_EQ(g.channels[0].tiles, small_channel().tiles);
  EXPECT_EQ(g.channels[0].brick_min, small_channel().brick_min);
  EXPECT_EQ(g.channels[0].index_to_world, small_channel().index_to_world);
}

TEST(GridBlob, GivesBackErrorsAndInfos) {
  const auto error = parse_result(bytes_of(Error(ErrorKind::InvalidInput, "f.vdb: no")));
  EXPECT_STREQ(std::get<Error>(error).what(), "f.vdb: no");
  GridFileInfo info;
  info.grids.resize(1);
  info.grids[0].name = "a";
  info.grids[0].index_max = Vec3i(4, 5, 6);
  info.grids[0].role = GridRole::Color;
  info.warnings = {"w"};
  const auto back = std::get<GridFileInfo>(parse_result(bytes_of(info)));
  EXPECT_EQ(back.grids[0].name, "a");
  EXPECT_EQ(back.grids[0].index_max, Vec3i(4, 5, 6));
  EXPECT_EQ(back.grids[0].role, GridRole::Color);
  EXPECT_EQ(back.warnings, info.warnings);
}

TEST(GridBlob, RequestsSurviveTheWay) {
  LoaderRequest request;
  request.file = "a\nb.vdb";
  request.grids = {{GridRole::Flame, "burn[1]", false}, {}};
  request.options.background = BackgroundPolicy::Keep;
  request.options.max_voxels = 77;
  const UniqueFd fd = make_memory_file("test");
  write_request(fd.get(), request);
  const LoaderRequest back = read_request(fd.get());
  EXPECT_EQ(back.file, request.file);
  ASSERT_EQ(back.grids.size(), 2u);
  EXPECT_EQ(back.grids[0].name, "burn[1]");
  EXPECT_EQ(back.grids[0].role, GridRole::Flame);
  EXPECT_FALSE(back.grids[0].required);
  EXPECT_FALSE(back.grids[1].name.has_value());
  EXPECT_EQ(back.options.background, BackgroundPolicy::Keep);
  EXPECT_EQ(back.options.max_voxels, 77u);
}

TEST(GridBlob, RefusesEveryTruncation) {
  const auto bytes = bytes_of(small_list());
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(parse_result({bytes.data(), size}), BlobError) << size;
}

TEST(GridBlob, RefusesBytesPastTheEnd) {
  auto bytes = bytes_of(small_list());
  bytes.push_back(0);
  EXPECT_THROW(parse_result(bytes), BlobError);
}

TEST(GridBlob, RefusesValuesNoGridMayHold) {
  const auto refused = [](auto change) {
    LoadedList list = small_list();
    change(list[1]->channels[0]);
    EXPECT_THROW(parse_result(bytes_of(list)), BlobError);
  };
  refused([](BrickArrays& a) { a.bricks[7] = std::numeric_limits<float>::quiet_NaN(); });
  refused([](BrickArrays& a) { a.bricks[7] = std::numeric_limits<float>::infinity(); });
  refused([](BrickArrays& a) { a.tiles[0] = -1; });
  refused([](BrickArrays& a) { a.bricks.pop_back(); });
  refused([](BrickArrays& a) { a.top[1] = 1; });
  refused([](BrickArrays& a) { a.top[1] = -3; });
  refused([](BrickArrays& a) { a.top[1] = std::numeric_limits<std::int32_t>::min(); });
  refused([](BrickArrays& a) { a.top.push_back(0); });
  refused([](BrickArrays& a) { a.brick_count = Vec3i(1 << 20, 1 << 20, 1 << 20); });
  refused([](BrickArrays& a) { a.brick_count.x = -3; });
  refused([](BrickArrays& a) { a.brick_min.x = std::numeric_limits<int>::min(); });
  refused([](BrickArrays& a) { a.index_to_world.m[0][0] = 0; });
  refused([](BrickArrays& a) { a.index_to_world.m[0][3] = kInfinity; });
}

TEST(GridBlob, LiesAboutCountsCostNoMemory) {
  const auto bytes = bytes_of(small_list());
  // Every 4- and 8-byte word in turn claims to be huge.
  for (std::size_t at = kTrailBytes; at + 8 <= std::min<std::size_t>(bytes.size(), 1200); ++at) {
    for (const std::size_t width : {4u, 8u}) {
      auto changed = bytes;
      std::memset(changed.data() + at, 0xff, width);
      changed[at + width - 1] = 0x7f;
      try {
        parse_result(changed);
      } catch (const BlobError&) {
      }
    }
  }
}

TEST(GridBlob, RandomBytesNeitherCrashNorSwell) {
  const auto bytes = bytes_of(small_list());
  RandomStream random(7);
  int refused = 0;
  for (int i = 0; i < 20'000; ++i) {
    auto changed = bytes;
    for (int k = 0; k < 3; ++k)
      changed[kTrailBytes + random.bits() % (bytes.size() - kTrailBytes)] = char(random.bits());
    try {
      parse_result(changed);
    } catch (const BlobError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 100);
}

TEST(GridBlob, ASealedFileCannotChange) {
  const UniqueFd fd = make_memory_file("test");
  ASSERT_EQ(::write(fd.get(), "x", 1), 1);
  ASSERT_TRUE(seal_memory_file(fd.get()));
  EXPECT_LT(::write(fd.get(), "y", 1), 0);
  EXPECT_NE(::ftruncate(fd.get(), 0), 0);
}

}  // namespace
}  // namespace brume
