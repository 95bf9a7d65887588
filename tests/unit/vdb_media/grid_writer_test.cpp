#include "vdb_media/grid_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "grid_fixtures.h"

namespace brume {
namespace {

using testing::HasSubstr;

TEST(GridWriter, SameArgumentsGiveTheSameBytes) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {ball_grid(9), ball_grid(5, "temperature")});
  write_grids(dir / "b.vdb", {ball_grid(9), ball_grid(5, "temperature")});
  write_grids(dir / "c.vdb", {ball_grid(8), ball_grid(5, "temperature")});
  EXPECT_EQ(read_file(dir / "a.vdb"), read_file(dir / "b.vdb"));
  EXPECT_NE(read_file(dir / "a.vdb"), read_file(dir / "c.vdb"));
}

TEST(GridWriter, TheGridComesBackValueForValue) {
  const TempDir dir;
  GridToWrite g = ball_grid(9);
  g.index_to_world.m = {{{0.3, 0.1, 0, 1}, {0, 0.2, 0, 2}, {0.1, 0, -0.4, 3}}};
  write_grids(dir / "a.vdb", {g});
  const LoadedGrid loaded = load_density(dir / "a.vdb");
  ASSERT_EQ(loaded.channels.size(), 1u);
  std::size_t n = 0;
  for (int z = 0; z < g.count.z; ++z)
    for (int y = 0; y < g.count.y; ++y)
      for (int x = 0; x < g.count.x; ++x)
        EXPECT_EQ(node(*loaded.channels[0], g.first + Vec3i(x, y, z)), g.values[n++]);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j)
      EXPECT_DOUBLE_EQ(loaded.channels[0]->index_to_world().m[i][j], g.index_to_world.m[i][j]);
  EXPECT_THAT(loaded.warnings, testing::IsEmpty());
}

TEST(GridWriter, VectorsComeBackAsThreeChannels) {
  const TempDir dir;
  GridToWrite g = block_grid(Vec3i(3), Vec3i(2), 0, "Cd");
  g.is_vec3 = true;
  g.values.assign(24, 0);
  for (std::size_t i = 0; i < 24; ++i) g.values[i] = float(i) / 32;
  write_grids(dir / "a.vdb", {g});
  const auto loaded = load_list(dir / "a.vdb", {{GridRole::Color, std::nullopt, true}}).at(0);
  ASSERT_EQ(loaded->channels.size(), 3u);
  for (int i = 0; i < 8; ++i)
    for (int c = 0; c < 3; ++c)
      EXPECT_EQ(node(*loaded->channels[c], Vec3i(3 + (i & 1), 3 + (i >> 1 & 1), 3 + (i >> 2))),
                g.values[3 * i + c]);
}

TEST(GridWriter, ConstantRegionsStaySmall) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {block_grid(Vec3i(0), Vec3i(256), 0.25f)});
  EXPECT_LT(std::filesystem::file_size(dir / "a.vdb"), 100'000u);
}

TEST(GridWriter, HalfFloatsKeepElevenBits) {
  const TempDir dir;
  GridToWrite g = ball_grid(6);
  g.save_as_half = true;
  EXPECT_THAT(write_grids(dir / "a.vdb", {g}), testing::IsEmpty());
  const LoadedGrid loaded = load_density(dir / "a.vdb");
  std::size_t n = 0;
  for (int z = -6; z <= 6; ++z)
    for (int y = -6; y <= 6; ++y)
      for (int x = -6; x <= 6; ++x, ++n)
        EXPECT_NEAR(node(*loaded.channels[0], {x, y, z}), g.values[n], g.values[n] / 2048);
}

TEST(GridWriter, SaysWhatHalfFloatsCannotHold) {
  const TempDir dir;
  GridToWrite g = block_grid(Vec3i(0), Vec3i(2), 1e-9f);
  g.save_as_half = true;
  EXPECT_THAT(write_grids(dir / "a.vdb", {g}), testing::ElementsAre(HasSubstr("8 values")));
  g.values[0] = 70'000;
  const Error e = error_of([&] { write_grids(dir / "b.vdb", {g}); });
  EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(e.what(), HasSubstr("65504"));
  EXPECT_FALSE(std::filesystem::exists(dir / "b.vdb"));
}

TEST(GridWriter, RefusesGridsThatNoFileHolds) {
  const TempDir dir;
  GridToWrite wrong_size = ball_grid(3), singular = ball_grid(3);
  wrong_size.values.pop_back();
  singular.index_to_world.m[2] = {0, 0, 0, 0};
  for (const auto& g : {wrong_size, singular})
    EXPECT_EQ(error_of([&] { write_grids(dir / "a.vdb", {g}); }).kind(), ErrorKind::InvalidInput);
}

TEST(GridWriter, AFailureLeavesTheOldFileAndNothingBeside) {
  const TempDir dir;
  const Error e = error_of([&] { write_grids(dir / "no/such/folder/a.vdb", {ball_grid(3)}); });
  EXPECT_EQ(e.kind(), ErrorKind::Resource);
  EXPECT_THAT(e.what(), HasSubstr("a.vdb"));
  write_grids(dir / "a.vdb", {ball_grid(3)});
  const std::string before = read_file(dir / "a.vdb");
  GridToWrite bad = ball_grid(3);
  bad.values.clear();
  error_of([&] { write_grids(dir / "a.vdb", {bad}); });
  EXPECT_EQ(read_file(dir / "a.vdb"), before);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(dir / ""), {}), 1);
}

}  // namespace
}  // namespace brume
