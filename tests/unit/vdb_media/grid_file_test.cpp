// SPEC's table "VDB input", row by row, on files that grid_writer makes and on real ones. Types and
// transforms that grid_writer does not write are in openvdb_agreement_test.cpp.
#include "vdb_media/grid_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <chrono>
#include <limits>
#include <map>
#include <regex>
#include <thread>

#include "grid_fixtures.h"

namespace brume {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

const std::filesystem::path kData = BRUME_SHARED_DATA;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

#define SKIP_WITHOUT_DATA() \
  if (!std::filesystem::exists(kData / "vdb")) GTEST_SKIP() << "no shared test data"

GridRequest named(const std::string& name, GridRole role = GridRole::Density) {
  return {role, name, true};
}
GridRequest optional_role(GridRole role) { return {role, std::nullopt, false}; }

// Lookup.

TEST(GridFile, FindsEachRoleInOneFile) {
  const TempDir dir;
  GridToWrite velocity = block_grid(Vec3i(0), Vec3i(2), 0, "vel");
  velocity.is_vec3 = true;
  velocity.values.assign(24, 1);
  write_grids(dir / "a.vdb", {ball_grid(5, "Dens"), ball_grid(6, "HEAT"), ball_grid(7, "burn"),
                              ball_grid(8, "emission"), velocity});
  const auto grids = load_list(dir / "a.vdb", {{},
                                               optional_role(GridRole::Temperature),
                                               optional_role(GridRole::Flame),
                                               optional_role(GridRole::Emission),
                                               optional_role(GridRole::Color)});
  ASSERT_EQ(grids.size(), 5u);
  EXPECT_EQ(grids[0]->name, "Dens");
  EXPECT_EQ(grids[1]->name, "HEAT");
  EXPECT_EQ(grids[2]->name, "burn");
  EXPECT_EQ(grids[3]->name, "emission");
  EXPECT_FALSE(grids[4].has_value());
  EXPECT_THAT(grids[0]->warnings, ElementsAre(AllOf(HasSubstr("grid vel"), HasSubstr("ignored"))));
}

TEST(GridFile, AnOverrideWins) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {ball_grid(5), block_grid(Vec3i(0), Vec3i(3), 7, "ash")});
  const auto grid = load_list(dir / "a.vdb", {named("ash")}).at(0);
  EXPECT_EQ(grid->name, "ash");
  EXPECT_EQ(grid->channels[0]->range().max, 7);
}

TEST(GridFile, AMissingGridIsAnErrorThatListsWhatThereIs) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {ball_grid(5, "fog"), ball_grid(4, "smoke")});
  const Error e = load_error(dir / "a.vdb");
  EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(e.what(), AllOf(HasSubstr((dir / "a.vdb").string()), HasSubstr("fog (float)"),
                              HasSubstr("smoke (float)"), HasSubstr("\"grids\"")));
}

TEST(GridFile, AGridOfManyCopiesIsFoundByItsNumberInFileOrder) {
  const TempDir dir;
  std::vector<GridToWrite> grids;
  for (int i = 0; i < 12; ++i) grids.push_back(block_grid(Vec3i(0), Vec3i(2), float(i + 1)));
  write_grids(dir / "a.vdb", grids);
  for (int i = 0; i < 12; ++i) {
    const auto grid = load_list(dir / "a.vdb", {named("density[" + std::to_string(i) + "]")}).at(0);
    EXPECT_EQ(grid->channels[0]->range().max, float(i + 1));
    EXPECT_EQ(grid->name, "density[" + std::to_string(i) + "]");
  }
  EXPECT_THAT(load_error(dir / "a.vdb").what(), HasSubstr("density[11]"));
}

TEST(GridFile, ThreeGridsOfOneNameInARealFile) {
  SKIP_WITHOUT_DATA();
  const auto file = kData / "vdb/three_grids_same_name.vdb";
  EXPECT_THAT(load_error(file).what(), HasSubstr("density[0], density[1], density[2]"));
  // By their places in the world (VDB_STATS.txt).
  const double kCenterX[] = {4, 2, 0};
  for (int i = 0; i < 3; ++i) {
    const auto grid = load_list(file, {named("density[" + std::to_string(i) + "]")}).at(0);
    const Box3d box = grid->channels[0]->world_bounds();
    EXPECT_NEAR(box.center().x, kCenterX[i], 0.2) << i;
  }
}

// Class.

TEST(GridFile, ALevelSetIsRefusedWithTheFix) {
  const TempDir dir;
  GridToWrite g = ball_grid(5);
  g.is_level_set = true;
  g.background = 0.3f;
  write_grids(dir / "a.vdb", {g});
  const Error e = load_error(dir / "a.vdb");
  EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(e.what(),
              AllOf(HasSubstr("grid density"), HasSubstr("level set"), HasSubstr("fog volume")));
}

TEST(GridFile, RealFilesOfOtherKindsAreRefusedPolitely) {
  SKIP_WITHOUT_DATA();
  EXPECT_THAT(load_error(kData / "vdb/levelset_sphere.vdb").what(),
              AllOf(HasSubstr("ls_sphere (float, level set)"), HasSubstr("convert it to a fog")));
  EXPECT_THAT(load_error(kData / "vdb/levelset_sphere.vdb", named("ls_sphere")).what(),
              AllOf(HasSubstr("grid ls_sphere"), HasSubstr("sdfToFogVolume")));
  EXPECT_THAT(load_error(kData / "vdb/points_unsupported.vdb").what(),
              AllOf(HasSubstr("points"), HasSubstr("rasterise")));
  EXPECT_THAT(load_error(kData / "vdb/points_unsupported.vdb", named("points")).what(),
              AllOf(HasSubstr("grid points"), HasSubstr("not supported")));
  EXPECT_THAT(load_error(kData / "vdb/velocity_vec3_constant.vdb", named("vel")).what(),
              HasSubstr("vector grid"));
  EXPECT_THAT(load_error(kData / "vdb/torus_dense.vdb").what(),
              HasSubstr("\"grids\": {\"density\": \"voxel_fog_density\"}"));
}

// Values.

TEST(GridFile, FieldFallsToZeroOneVoxelOutsideAndNoFurther) {
  const TempDir dir;
  // Across the corner of eight bricks, and at the low face of one.
  for (const Vec3i& at : {Vec3i(0), Vec3i(7), Vec3i(-1), Vec3i(8, -8, 15)}) {
    write_grids(dir / "a.vdb", {block_grid(at, Vec3i(1), 2)});
    const LoadedGrid loaded = load_density(dir / "a.vdb");
    const BrickGrid& grid = *loaded.channels[0];
    const Vec3d p(at);
    EXPECT_EQ(grid.sample(p), 2);
    for (int a = 0; a < 3; ++a)
      for (const double s : {-1.0, 1.0}) {
        Vec3d half = p, whole = p;
        half[a] += s / 2;
        whole[a] += s;
        EXPECT_FLOAT_EQ(grid.sample(half), 1) << at << a << s;
        EXPECT_EQ(grid.sample(whole), 0) << at << a << s;
      }
    EXPECT_FLOAT_EQ(grid.sample(p + Vec3d(0.5, -0.5, 0.5)), 0.25f);
  }
}

TEST(GridFile, ConstantTilesStayTiles) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {block_grid(Vec3i(0), Vec3i(256), 0.25f)});
  const LoadedGrid loaded = load_density(dir / "a.vdb");
  const BrickGrid& grid = *loaded.channels[0];
  // Only the bricks of the outer faces are stored: 33^3 - 31^3.
  EXPECT_EQ(grid.stored_brick_count(), 33u * 33 * 33 - 31 * 31 * 31);
  EXPECT_EQ(grid.sample(Vec3d(128.3, 77.7, 12.1)), 0.25f);
  EXPECT_EQ(grid.sample(Vec3d(0, 0, 0)), 0.25f);
  EXPECT_EQ(grid.sample(Vec3d(255, 255, 255)), 0.25f);
  EXPECT_FLOAT_EQ(grid.sample(Vec3d(255.5, 3, 3)), 0.125f);
  EXPECT_EQ(grid.sample(Vec3d(256, 3, 3)), 0);
}

// Empty.

TEST(GridFile, NothingIsVacuumWithOneWarning) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {block_grid(Vec3i(0), Vec3i(0), 0)});
  const LoadedGrid loaded = load_density(dir / "a.vdb");
  ASSERT_EQ(loaded.channels.size(), 1u);
  EXPECT_TRUE(loaded.channels[0]->is_empty());
  EXPECT_THAT(loaded.warnings, ElementsAre(AllOf(HasSubstr("grid density"), HasSubstr("vacuum"))));
}

TEST(GridFile, RealFilesThatHoldNothingAreVacuumWithOneWarning) {
  SKIP_WITHOUT_DATA();
  const LoadedGrid none = load_density(kData / "malformed/no_active_voxels.vdb");
  EXPECT_TRUE(none.channels[0]->is_empty());
  EXPECT_THAT(none.warnings, ElementsAre(HasSubstr("no active voxel")));
  const LoadedGrid zero = load_density(kData / "malformed/all_zero_density.vdb");
  EXPECT_TRUE(zero.channels[0]->is_empty());
  EXPECT_THAT(zero.warnings, ElementsAre(HasSubstr("0 everywhere")));
}

// Background.

TEST(GridFile, ABackgroundIsAnErrorUnlessAPolicySaysOtherwise) {
  const TempDir dir;
  // Active: the box 5..14; background 3 around.
  GridToWrite g = block_grid(Vec3i(5), Vec3i(10), 1);
  g.background = 3;
  write_grids(dir / "a.vdb", {g});
  const Error e = load_error(dir / "a.vdb");
  EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(e.what(), AllOf(HasSubstr("grid density"), HasSubstr("background is 3"),
                              HasSubstr("--background zero")));

  GridFileOptions zero;
  zero.background = BackgroundPolicy::Zero;
  const LoadedGrid without = load_density(dir / "a.vdb", zero);
  EXPECT_THAT(without.warnings, ElementsAre(HasSubstr("background 3")));
  EXPECT_EQ(without.channels[0]->range().max, 1);
  EXPECT_EQ(node(*without.channels[0], Vec3i(5)), 1);
  EXPECT_EQ(node(*without.channels[0], Vec3i(4)), 0);
}

TEST(GridFile, AKeptBackgroundFillsTheActiveBoxAndNothingElse) {
  const TempDir dir;
  // Two active corners, background between them.
  GridToWrite low = block_grid(Vec3i(2), Vec3i(39), 0);
  low.background = 3;
  low.values.assign(low.values.size(), 3);
  low.values.front() = low.values.back() = 1;
  write_grids(dir / "a.vdb", {low});
  GridFileOptions keep;
  keep.background = BackgroundPolicy::Keep;
  const LoadedGrid loaded = load_density(dir / "a.vdb", keep);
  EXPECT_THAT(loaded.warnings, ElementsAre(HasSubstr("fills the box")));
  const BrickGrid& grid = *loaded.channels[0];
  EXPECT_EQ(node(grid, Vec3i(2)), 1);
  EXPECT_EQ(node(grid, Vec3i(40)), 1);
  EXPECT_EQ(node(grid, Vec3i(20)), 3);
  EXPECT_EQ(node(grid, Vec3i(2, 2, 40)), 3);
  for (int a = 0; a < 3; ++a) {
    Vec3i out(20);
    out[a] = 1;
    EXPECT_EQ(node(grid, out), 0);
    out[a] = 41;
    EXPECT_EQ(node(grid, out), 0);
  }
}

// Bad voxels.

GridToWrite poisoned_grid() {
  GridToWrite g = block_grid(Vec3i(0), Vec3i(4), 1);
  g.values[5] = kNan;   // (1, 1, 0)
  g.values[6] = kInf;   // (2, 1, 0)
  g.values[7] = -2;     // (3, 1, 0)
  g.values[8] = 2e30f;  // (0, 2, 0)
  g.values[9] = -kInf;  // (1, 2, 0)
  g.values[10] = 5;     // (2, 2, 0), the largest good one
  return g;
}

TEST(GridFile, BadVoxelsBecomeZeroAndAreCounted) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {poisoned_grid()});
  const LoadedGrid loaded = load_density(dir / "a.vdb");
  EXPECT_EQ(loaded.bad_voxels.nan, 1u);
  EXPECT_EQ(loaded.bad_voxels.infinite, 3u);
  EXPECT_EQ(loaded.bad_voxels.negative, 1u);
  EXPECT_THAT(loaded.warnings,
              ElementsAre(AllOf(HasSubstr("5 bad voxels"), HasSubstr("(1, 1, 0)"),
                                HasSubstr("set to 0"), HasSubstr("grid density"))));
  const BrickGrid& grid = *loaded.channels[0];
  for (const Vec3i& p :
       {Vec3i(1, 1, 0), Vec3i(2, 1, 0), Vec3i(3, 1, 0), Vec3i(0, 2, 0), Vec3i(1, 2, 0)})
    EXPECT_EQ(node(grid, p), 0) << p;
  EXPECT_EQ(grid.range().max, 5);
}

TEST(GridFile, BadVoxelsMayBeClampedToWhatIsValid) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {poisoned_grid()});
  GridFileOptions clamp;
  clamp.on_bad_voxels = BadVoxelPolicy::Clamp;
  const LoadedGrid loaded = load_density(dir / "a.vdb", clamp);
  EXPECT_EQ(loaded.bad_voxels.total(), 5u);
  EXPECT_EQ(loaded.warnings.size(), 1u);
  const BrickGrid& grid = *loaded.channels[0];
  EXPECT_EQ(node(grid, {1, 1, 0}), 0);
  EXPECT_EQ(node(grid, {2, 1, 0}), 5);
  EXPECT_EQ(node(grid, {3, 1, 0}), 0);
  EXPECT_EQ(node(grid, {0, 2, 0}), 5);
  EXPECT_EQ(node(grid, {1, 2, 0}), 0);
}

TEST(GridFile, BadVoxelsMayBeAnError) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {poisoned_grid()});
  GridFileOptions strict;
  strict.on_bad_voxels = BadVoxelPolicy::Error;
  const Error e = load_error(dir / "a.vdb", {}, strict);
  EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(e.what(),
              AllOf(HasSubstr("grid density"), HasSubstr("1 NaN"), HasSubstr("3 infinite"),
                    HasSubstr("1 negative"), HasSubstr("(1, 1, 0)")));
}

TEST(GridFile, BadVoxelsInTilesCountAsManyAsTheTileHolds) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {block_grid(Vec3i(0), Vec3i(64), kInf)});
  EXPECT_EQ(load_density(dir / "a.vdb").bad_voxels.infinite, 64u * 64 * 64);
}

TEST(GridFile, ColoursAreSanitisedToo) {
  const TempDir dir;
  GridToWrite g = block_grid(Vec3i(0), Vec3i(2), 0, "Cd");
  g.is_vec3 = true;
  g.values.assign(24, 0.5f);
  g.values[3] = kNan;
  g.values[4] = -1;
  g.values[9] = -1;
  write_grids(dir / "a.vdb", {g});
  const auto loaded = load_list(dir / "a.vdb", {{GridRole::Color, std::nullopt, true}}).at(0);
  EXPECT_EQ(loaded->bad_voxels.nan, 1u);  // A voxel counts once, by its worst channel.
  EXPECT_EQ(loaded->bad_voxels.negative, 1u);
  EXPECT_EQ(loaded->warnings.size(), 1u);
  EXPECT_EQ(node(*loaded->channels[0], {1, 0, 0}), 0);
  EXPECT_EQ(node(*loaded->channels[1], {1, 0, 0}), 0);
  EXPECT_EQ(node(*loaded->channels[2], {1, 0, 0}), 0.5f);
}

// Transforms.

TEST(GridFile, EachGridKeepsItsOwnLinearTransform) {
  const TempDir dir;
  const double c = std::cos(0.5), s = std::sin(0.5);
  std::vector<Affine3d> maps(5);
  maps[0] = scaling(0.25, {1, 2, 3});
  maps[1].m = {{{0.1, 0, 0, 0}, {0, 0.2, 0, 0}, {0, 0, 0.3, 5}}};  // Not uniform.
  maps[2].m = {{{c, -s, 0, 1}, {s, c, 0, 0}, {0, 0, 1, 0}}};       // Rotated.
  maps[3].m = {{{1, 0.5, 0, 0}, {0, 1, 0.25, 0}, {0, 0, 1, 0}}};   // Sheared.
  maps[4].m = {{{-1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};       // Mirrored.
  std::vector<GridToWrite> grids;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    grids.push_back(ball_grid(4, "g" + std::to_string(i)));
    grids.back().index_to_world = maps[i];
  }
  write_grids(dir / "a.vdb", grids);
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const auto grid = load_list(dir / "a.vdb", {named("g" + std::to_string(i))}).at(0);
    EXPECT_THAT(grid->warnings, IsEmpty());
    for (int r = 0; r < 3; ++r)
      for (int k = 0; k < 4; ++k)
        EXPECT_NEAR(grid->channels[0]->index_to_world().m[r][k], maps[i].m[r][k], 1e-12)
            << "map " << i;
  }
}

TEST(GridFile, RefusesWhatNoDoubleCanMarch) {
  const TempDir dir;
  GridToWrite big = ball_grid(3), far = ball_grid(3), thin = ball_grid(3);
  big.index_to_world = scaling(1e10);
  far.index_to_world = scaling(1e-3, {1e12, 0, 0});
  thin.index_to_world.m = {{{1, 1, 0, 0}, {1, 1 + 1e-10, 0, 0}, {0, 0, 1, 0}}};
  for (const auto& [grid, reason] : {std::pair(big, "outside 1e-5..1e9"), std::pair(far, "too far"),
                                     std::pair(thin, "singular")}) {
    write_grids(dir / "a.vdb", {grid});
    const Error e = load_error(dir / "a.vdb");
    EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
    EXPECT_THAT(e.what(), AllOf(HasSubstr("grid density"), HasSubstr(reason)));
  }
}

TEST(GridFile, RefusesIndicesNearTheEndsOfInt) {
  const TempDir dir;
  for (const int at : {(1 << 30) + 8, -(1 << 30) - 8, std::numeric_limits<int>::max() - 9,
                       std::numeric_limits<int>::min() + 8}) {
    write_grids(dir / "a.vdb", {block_grid(Vec3i(at, 0, 0), Vec3i(1), 1)});
    EXPECT_THAT(load_error(dir / "a.vdb").what(), HasSubstr("2^30")) << at;
  }
}

// Files that are none.

TEST(GridFile, RefusesWhatIsNoOpenVdbFile) {
  const TempDir dir;
  const std::vector<std::pair<std::string, std::string>> kCases{
      {"", "is empty"},
      {"hello, world, this is a text", "not an OpenVDB file"},
      {" BD", "cut off"},
      {"NanoVDB1 and so on", "nanovdb_convert"},
      {"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"},
      {"\x1f\x8b\x08 and so on", "unpack"}};
  for (const auto& [bytes, reason] : kCases) {
    write_file(dir / "a.vdb", bytes);
    const Error e = load_error(dir / "a.vdb");
    EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
    EXPECT_THAT(e.what(), AllOf(HasSubstr((dir / "a.vdb").string()), HasSubstr(reason)));
  }
}

TEST(GridFile, RefusesPathsThatAreNoRegularFiles) {
  const TempDir dir;
  ASSERT_EQ(::mkfifo((dir / "fifo").c_str(), 0600), 0);
  std::filesystem::create_symlink(dir / "loop", dir / "loop");
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THAT(load_error(dir / "fifo").what(), HasSubstr("not a regular file"));
  EXPECT_THAT(load_error("/dev/zero").what(), HasSubstr("not a regular file"));
  EXPECT_THAT(load_error(dir / "").what(), HasSubstr("directory"));
  EXPECT_THAT(load_error(dir / "none.vdb").what(), HasSubstr("No such file"));
  EXPECT_THAT(load_error(dir / "loop").what(), HasSubstr("cannot be opened"));
  EXPECT_THAT(load_error(std::string("a\0b", 3)).what(), HasSubstr("NUL"));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
}

TEST(GridFile, RealFilesThatAreNoOpenVdb) {
  SKIP_WITHOUT_DATA();
  const Error nano = load_error(kData / "malformed/teapot_cloud_is_nanovdb.vdb");
  EXPECT_EQ(nano.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(nano.what(), HasSubstr("NanoVDB"));
  const Error lfs = load_error(kData / "malformed/lfs_pointer.vdb");
  EXPECT_EQ(lfs.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(lfs.what(), HasSubstr("Git LFS"));
}

// Limits.

TEST(GridFile, TheClockEndsAReaderThatTakesTooLong) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {ball_grid(5)});
  GridFileOptions hurried;
  hurried.timeout_s = 1e-4;
  const Error e = load_error(dir / "a.vdb", {}, hurried);
  EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(e.what(), HasSubstr("not read within 0.0001 s"));
}

TEST(GridFile, MemoryIsLimited) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {ball_grid(60)});  // 7 MB of voxels.
  GridFileOptions tight;
  tight.memory_limit_bytes = 4 << 20;
  const Error e = load_error(dir / "a.vdb", {}, tight);
  EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
  EXPECT_THAT(e.what(), HasSubstr("a.vdb"));
}

TEST(GridFile, VoxelsAreLimited) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {block_grid(Vec3i(0), Vec3i(32), 1)});
  GridFileOptions few;
  few.max_voxels = 32767;
  EXPECT_THAT(load_error(dir / "a.vdb", {}, few).what(),
              AllOf(HasSubstr("32768 active voxels"), HasSubstr("--max-voxels")));
  few.max_voxels = 32768;
  EXPECT_NO_THROW(load_density(dir / "a.vdb", few));
}

TEST(GridFile, AnImpossibleTimeLimitIsAUsageError) {
  for (const double s : {0.0, -1.0, double(kNan), double(kInf)}) {
    GridFileOptions options;
    options.timeout_s = s;
    EXPECT_EQ(load_error("a.vdb", {}, options).kind(), ErrorKind::Usage);
  }
}

// The parent.

TEST(GridFile, ManyThreadsMayLoadAtOnce) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {ball_grid(9)});
  const Fingerprint expected = load_density(dir / "a.vdb").channels[0]->fingerprint();
  std::vector<std::thread> threads;
  std::atomic<int> same = 0;
  for (int i = 0; i < 6; ++i)
    threads.emplace_back(
        [&] { same += load_density(dir / "a.vdb").channels[0]->fingerprint() == expected; });
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(same, 6);
}

TEST(GridFile, LeavesNoDescriptorsBehind) {
  const TempDir dir;
  write_grids(dir / "a.vdb", {ball_grid(5)});
  const auto count = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
  };
  load_density(dir / "a.vdb");
  const auto before = count();
  load_density(dir / "a.vdb");
  load_error(dir / "none.vdb");
  EXPECT_EQ(count(), before);
}

// Inspection.

TEST(GridFile, InspectionShowsWhatIsThere) {
  const TempDir dir;
  GridToWrite velocity = block_grid(Vec3i(0), Vec3i(2), 0, "vel");
  velocity.is_vec3 = true;
  velocity.values.assign(24, 1);
  GridToWrite temperature = ball_grid(6, "temp");
  temperature.save_as_half = true;
  write_grids(dir / "a.vdb", {poisoned_grid(), temperature, velocity});
  const GridFileInfo info = inspect_grid_file(dir / "a.vdb", {});
  ASSERT_EQ(info.grids.size(), 3u);
  const GridInfo& g = info.grids[0];
  EXPECT_EQ(g.name, "density");
  EXPECT_EQ(g.type, "float");
  EXPECT_EQ(g.grid_class, "fog volume");
  EXPECT_EQ(g.active_voxels, 64u);
  EXPECT_EQ(g.nan_voxels, 1u);
  EXPECT_EQ(g.infinite_voxels, 2u);
  EXPECT_EQ(g.negative_voxels, 1u);
  EXPECT_EQ(g.role, GridRole::Density);
  EXPECT_EQ(g.index_max, Vec3i(3));
  EXPECT_NEAR(g.world_bounds.min.x, -0.05, 1e-12);
  EXPECT_NEAR(g.world_bounds.max.x, 0.35, 1e-12);
  EXPECT_EQ(info.grids[1].role, GridRole::Temperature);
  EXPECT_TRUE(info.grids[1].saved_as_half);
  EXPECT_EQ(info.grids[1].proposed_density_scale, 0);
  EXPECT_EQ(info.grids[2].type, "vec3s");
  EXPECT_NEAR(info.grids[2].mean, std::sqrt(3), 1e-6);
  EXPECT_FALSE(info.grids[2].role.has_value());
  EXPECT_THAT(info.warnings, testing::Contains(HasSubstr("velocity is not used")));
}

TEST(GridFile, TheProposedScaleGivesAnOpticalDepthOfThree) {
  const TempDir dir;
  GridToWrite g = block_grid(Vec3i(0), Vec3i(32), 0.5f);
  g.index_to_world = scaling(0.125);  // A cube 4 across: 3 / (0.5 * 4) = 1.5.
  write_grids(dir / "a.vdb", {g});
  EXPECT_DOUBLE_EQ(inspect_grid_file(dir / "a.vdb", {}).grids[0].proposed_density_scale, 1.5);
}

struct ExpectedGrid {
  std::string file, name, type, grid_class, map;
  bool half = false;
  double active = 0, min = 0, max = 0, mean = 0;
  std::string index_box, world_box;
};

std::string field(const std::string& line, const std::string& pattern) {
  std::smatch m;
  return std::regex_search(line, m, std::regex(pattern)) ? m[1].str() : "";
}

std::vector<ExpectedGrid> read_stats() {
  std::vector<ExpectedGrid> list;
  std::ifstream in(kData / "VDB_STATS.txt");
  std::string file;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("FILE ")) file = field(line, "^FILE ([^ ]+)");
    if (!line.starts_with("  GRID ")) continue;
    ExpectedGrid g;
    g.file = file;
    g.name = field(line, "GRID '([^']*)'");
    g.type = field(line, "type=Tree_([a-z0-9]+)_");
    g.grid_class = field(line, "class=([a-z ]+?) half");
    g.map = field(line, "map=([A-Za-z]+)");
    g.half = field(line, "half=([01])") == "1";
    g.active = std::stod(field(line, "active=([0-9]+)"));
    const auto number = [&](const std::string& key) {
      const std::string text = field(line, key + "=([-0-9.e]*[0-9])");
      return text.empty() ? 0 : std::stod(text);
    };
    g.min = number("min\\|?");
    g.max = number("max\\|?");
    g.mean = number("mean");
    if (line.find("|v|min") != std::string::npos) {
      g.min = number("\\|v\\|min");
      g.max = number("\\|v\\|max");
    }
    g.index_box = field(line, "ibox=([^ ]+)");
    g.world_box = field(line, "wbox=([^ ]+)");
    list.push_back(g);
  }
  return list;
}

// As VDB_STATS.txt prints boxes: six digits.
std::string text_of(const Vec3d& a, const Vec3d& b, const char* brackets) {
  char text[256];
  std::snprintf(text, sizeof text, "%c%.6g,%.6g,%.6g%c..%c%.6g,%.6g,%.6g%c", brackets[0], a.x, a.y,
                a.z, brackets[1], brackets[0], b.x, b.y, b.z, brackets[1]);
  return text;
}

TEST(GridFile, InspectionOfRealFilesAgreesWithWhatOpenVdbSays) {
  SKIP_WITHOUT_DATA();
  std::map<std::string, std::size_t> next;
  const auto expected = read_stats();
  ASSERT_GE(expected.size(), 14u);
  for (const ExpectedGrid& e : expected) {
    SCOPED_TRACE(e.file + " " + e.name);
    const GridFileInfo info = inspect_grid_file(kData / e.file, {});
    const std::size_t i = next[e.file]++;
    ASSERT_LT(i, info.grids.size());
    const GridInfo& g = info.grids[i];
    EXPECT_THAT(g.name, testing::StartsWith(e.name));
    EXPECT_EQ(g.type, e.type);
    EXPECT_EQ(g.grid_class, e.grid_class);
    EXPECT_THAT(g.transform, HasSubstr(e.map));
    EXPECT_EQ(g.saved_as_half, e.half);
    EXPECT_EQ(double(g.active_voxels), e.active);
    if (e.active == 0 || e.type.starts_with("pt")) continue;
    EXPECT_NEAR(g.min, e.min, 1e-5 * std::abs(e.min));
    EXPECT_NEAR(g.max, e.max, 1e-5 * std::abs(e.max));
    if (e.type == "float") {
      EXPECT_NEAR(g.mean, e.mean, 1e-5 * std::abs(e.mean));
    }
    EXPECT_EQ(text_of(Vec3d(g.index_min), Vec3d(g.index_max), "[]"), e.index_box);
    EXPECT_EQ(text_of(g.world_bounds.min, g.world_bounds.max, "()"), e.world_box);
  }
}

TEST(GridFile, RealFogFilesLoadWithTheirRange) {
  SKIP_WITHOUT_DATA();
  for (const ExpectedGrid& e : read_stats()) {
    if (e.type != "float" || e.grid_class != "fog volume" || e.max == 0) continue;
    if (e.file.find("three_grids") != std::string::npos) continue;
    SCOPED_TRACE(e.file);
    const auto start = std::chrono::steady_clock::now();
    const auto grid = load_list(kData / e.file, {named(e.name)}).at(0);
    const double took =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    RecordProperty("seconds_" + std::filesystem::path(e.file).stem().string(),
                   std::to_string(took));
    EXPECT_EQ(grid->bad_voxels.total(), 0u);
    EXPECT_THAT(grid->warnings, IsEmpty());
    EXPECT_NEAR(grid->channels[0]->range().max, e.max, 1e-5 * e.max);
    EXPECT_LT(took, 10);
  }
}

}  // namespace
}  // namespace brume
