#include "vdb_media/brick_grid.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "unit/vdb_media/march_cases.h"

namespace brume {
namespace {

using namespace march_cases;

std::shared_ptr<const BrickGrid> one_voxel(const Vec3i& where, float value) {
  return BrickGrid::from_dense(where, Vec3i(1), {value}, {});
}

TEST(BrickGrid, HoldsEveryCellThatANodeTouches) {
  // A corner of eight bricks: one node, eight cells, eight bricks.
  EXPECT_EQ(one_voxel(Vec3i(8, 16, -8), 1)->stored_brick_count(), 8u);
  EXPECT_EQ(one_voxel(Vec3i(0, 3, 3), 1)->stored_brick_count(), 2u);
  EXPECT_EQ(one_voxel(Vec3i(1, 3, 3), 1)->stored_brick_count(), 1u);
  EXPECT_EQ(one_voxel(Vec3i(7, 3, 3), 1)->stored_brick_count(), 1u);
  for (const Vec3i& n : {Vec3i(8, 16, -8), Vec3i(0, 0, 0), Vec3i(-1, 7, -9), Vec3i(5, 4, 3)}) {
    const auto grid = one_voxel(n, 2);
    EXPECT_EQ(grid->index_bounds().min, Vec3d(n) - Vec3d(1));
    EXPECT_EQ(grid->index_bounds().max, Vec3d(n) + Vec3d(1));
    EXPECT_EQ(grid->sample(Vec3d(n)), 2);
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3d side(corner & 1 ? 0.5 : -0.5, corner & 2 ? 0.5 : -0.5, corner & 4 ? 0.5 : -0.5);
      EXPECT_FLOAT_EQ(grid->sample(Vec3d(n) + side), 0.25f);
      EXPECT_EQ(grid->sample(Vec3d(n) + side * 2.0), 0);
      EXPECT_EQ(grid->sample(Vec3d(n) + side * 3.0), 0);
    }
  }
}

TEST(BrickGrid, DropsZerosAndKeepsTiles) {
  std::vector<float> values(33 * 33 * 33, 0.0f);
  for (int z = 0; z <= 16; ++z)
    for (int y = 0; y <= 16; ++y)
      for (int x = 0; x <= 16; ++x) values[(z * 33 + y) * 33 + x] = 0.5f;
  const auto grid = BrickGrid::from_dense(Vec3i(0), Vec3i(33), values, {});
  // Cells 0..15 are constant: 2^3 tiles. The bricks around them hold the fall to zero.
  int tiles = 0, bricks = 0, empty = 0;
  Vec3i b;
  for (b.z = 0; b.z < grid->brick_count().z; ++b.z)
    for (b.y = 0; b.y < grid->brick_count().y; ++b.y)
      for (b.x = 0; b.x < grid->brick_count().x; ++b.x) {
        const std::int32_t top = grid->top(b);
        if (top == BrickGrid::kEmpty) {
          ++empty;
          EXPECT_EQ(grid->brick_range(top).max, 0);
        } else if (top < 0) {
          ++tiles;
          EXPECT_EQ(grid->tile(top), 0.5f);
          EXPECT_EQ(grid->brick_range(top).min, 0.5f);
        } else {
          ++bricks;
          EXPECT_EQ(grid->brick_range(top).min, 0);
          EXPECT_EQ(grid->brick_range(top).max, 0.5f);
        }
      }
  EXPECT_EQ(tiles, 8);
  EXPECT_EQ(bricks, 4 * 4 * 4 - 8);
  EXPECT_EQ(std::size_t(bricks), grid->stored_brick_count());
  EXPECT_GT(empty, 0);
  EXPECT_EQ(grid->index_bounds().min, Vec3d(-1));
  EXPECT_EQ(grid->index_bounds().max, Vec3d(17));
  EXPECT_EQ(grid->range().min, 0);
  EXPECT_EQ(grid->range().max, 0.5f);
  EXPECT_GE(grid->memory_bytes(), bricks * BrickGrid::kBrickFloats * sizeof(float));
}

TEST(BrickGrid, SamplesAndGradientsOfATrilinearFieldAreExact) {
  const auto f = [](const Vec3d& p) {
    return 40 + p.x - 2 * p.y + 0.5 * p.z + 0.25 * p.x * p.y - 0.125 * p.y * p.z +
           0.0625 * p.x * p.y * p.z;
  };
  const auto grid = make_grid(Vec3i(-4), Vec3i(9), {}, f);
  RandomStream random(random_key(21));
  for (int i = 0; i < 2000; ++i) {
    const Vec3d p(random.uniform() * 8 - 4, random.uniform() * 8 - 4, random.uniform() * 8 - 4);
    EXPECT_NEAR(grid->sample(p), f(p), 1e-5 * 50);
    const auto g = grid->sample_gradient(p);
    EXPECT_NEAR(g.value, f(p), 1e-6 * 50);
    EXPECT_NEAR(g.gradient.x, 1 + 0.25 * p.y + 0.0625 * p.y * p.z, 1e-5);
    EXPECT_NEAR(g.gradient.y, -2 + 0.25 * p.x - 0.125 * p.z + 0.0625 * p.x * p.z, 1e-5);
    EXPECT_NEAR(g.gradient.z, 0.5 - 0.125 * p.y + 0.0625 * p.x * p.y, 1e-5);
  }
}

TEST(BrickGrid, NothingOutsideNorAtNaN) {
  const auto grid = make_lumps({});
  for (const double far : {1e3, -1e3, 1e18, -1e300, double(NAN), kInfinity})
    for (int a = 0; a < 3; ++a) {
      Vec3d p = grid->index_bounds().center();
      p[a] = far;
      EXPECT_EQ(grid->sample(p), 0);
      EXPECT_EQ(grid->sample_gradient(p).value, 0);
    }
}

TEST(BrickGrid, EmptyGridsAreEmpty) {
  for (const auto& grid :
       {BrickGrid::from_dense(Vec3i(0), Vec3i(0), {}, {}),
        BrickGrid::from_dense(Vec3i(5), Vec3i(10), std::vector<float>(1000, 0.0f), {})}) {
    EXPECT_TRUE(grid->is_empty());
    EXPECT_TRUE(grid->index_bounds().isEmpty());
    EXPECT_TRUE(grid->world_bounds().isEmpty());
    EXPECT_EQ(grid->sample(Vec3d(7)), 0);
    EXPECT_EQ(grid->range().max, 0);
  }
}

TEST(BrickGrid, RefusesWhatDoesNotFitTogether) {
  const std::vector<float> brick(BrickGrid::kBrickFloats, 1.0f);
  const auto make = [](Vec3i min, Vec3i count, std::vector<std::int32_t> top,
                       std::vector<float> bricks, std::vector<float> tiles, Affine3d map) {
    return BrickGrid(min, count, std::move(top), std::move(bricks), std::move(tiles), map);
  };
  const Vec3i zero(0), one(1);
  EXPECT_NO_THROW(make(zero, one, {0}, brick, {}, {}));
  EXPECT_NO_THROW(make(zero, one, {-2}, {}, {1.0f}, {}));
  EXPECT_THROW(make(zero, one, {0, 0}, brick, {}, {}), Error);
  EXPECT_THROW(make(zero, one, {1}, brick, {}, {}), Error);
  EXPECT_THROW(make(zero, one, {-2}, brick, {}, {}), Error);
  EXPECT_THROW(make(zero, one, {INT32_MIN}, {}, {1.0f}, {}), Error);
  EXPECT_THROW(make(zero, Vec3i(-1, 1, 1), {}, {}, {}, {}), Error);
  EXPECT_THROW(make(zero, one, {0}, std::vector<float>(700, 1.0f), {}, {}), Error);
  EXPECT_THROW(make(Vec3i(1 << 28, 0, 0), one, {0}, brick, {}, {}), Error);
  EXPECT_THROW(make(Vec3i(INT32_MIN, 0, 0), one, {0}, brick, {}, {}), Error);
  EXPECT_THROW(make(zero, Vec3i(1 << 27), {}, {}, {}, {}), Error);
  for (const float bad : {-1.0f, float(NAN), float(INFINITY)}) {
    std::vector<float> values = brick;
    values[500] = bad;
    EXPECT_THROW(make(zero, one, {0}, values, {}, {}), Error) << bad;
    EXPECT_THROW(make(zero, one, {-2}, {}, {bad}, {}), Error) << bad;
    EXPECT_THROW(BrickGrid::from_dense(zero, one, {bad}, {}), Error) << bad;
  }
  Affine3d singular;
  singular.m[1][1] = 0;
  EXPECT_THROW(make(zero, one, {0}, brick, {}, singular), Error);
  singular.m[1][1] = NAN;
  EXPECT_THROW(make(zero, one, {0}, brick, {}, singular), Error);
  EXPECT_THROW(BrickGrid::from_dense(zero, Vec3i(2), {1.0f}, {}), Error);
  EXPECT_THROW(BrickGrid::from_dense(Vec3i(1 << 30, 0, 0), one, {1.0f}, {}), Error);
}

TEST(BrickGrid, VoxelSizeIsTheShortestEdge) {
  Affine3d map = scaling(Vec3d(-2, 3, 5));
  map.m[0][1] = 4;  // The y edge is (4, 3, 0).
  const auto grid = one_voxel(Vec3i(1), 1);
  EXPECT_EQ(grid->voxel_size(), 1);
  EXPECT_EQ(BrickGrid::from_dense(Vec3i(0), Vec3i(1), {1.0f}, map)->voxel_size(), 2);
  map.m[0][0] = 7;
  EXPECT_EQ(BrickGrid::from_dense(Vec3i(0), Vec3i(1), {1.0f}, map)->voxel_size(), 5);
}

TEST(BrickGrid, FingerprintFollowsWhatAnAnswerDependsOn) {
  std::vector<float> values(1000);
  for (int i = 0; i < 1000; ++i) values[i] = float(i % 7);
  const auto make = [&](const Vec3i& first, const Affine3d& map) {
    return BrickGrid::from_dense(first, Vec3i(10), values, map)->fingerprint();
  };
  const Fingerprint f = make(Vec3i(0), {});
  EXPECT_EQ(f, make(Vec3i(0), {}));
  EXPECT_NE(f, make(Vec3i(1, 0, 0), {}));
  EXPECT_NE(f, make(Vec3i(0), scaling(Vec3d(1), Vec3d(0, 0, 1e-9))));
  values[555] = std::nextafter(values[555], 10.0f);
  EXPECT_NE(f, make(Vec3i(0), {}));
}

}  // namespace
}  // namespace brume
