// Cells and walls of the hemisphere against sums over many directions and steps.
#include "gather/direction_cells.h"

#include <gtest/gtest.h>

namespace brume {
namespace {

// Where 1/cos, and what is summed with it, is too steep for an even grid of directions.
bool reaches_horizon(const DirectionCells& cells, int c) {
  for (int i = 0; i < 1024; ++i)
    if (cells.direction(c, {i / 1024.0, 0.5}).z < 0.05) return true;
  return false;
}

class Cells : public testing::TestWithParam<int> {};

TEST_P(Cells, FillTheHemisphere) {
  const DirectionCells cells(GetParam());
  ASSERT_EQ(cells.count(), GetParam());
  double measure = 0;
  Vec3d direction(0.0), rotation(0.0);
  for (int c = 0; c < cells.count(); ++c) {
    EXPECT_NEAR(cells.cell(c).measure, kPi / cells.count(), 1e-12);
    measure += cells.cell(c).measure;
    direction += cells.cell(c).direction;
    rotation += cells.cell(c).rotation;
  }
  EXPECT_NEAR(measure, kPi, 1e-12);
  EXPECT_NEAR((direction - Vec3d(0, 0, 2 * kPi / 3)).length(), 0, 1e-12);
  EXPECT_NEAR(rotation.length(), 0, 1e-12);
}

// Directions of a cell, uniform in its cosine-weighted area, average to its moments: W = G mean(w)
// and R = G mean(n x w / cos).
TEST_P(Cells, HaveTheMomentsOfTheirDirections) {
  const DirectionCells cells(GetParam());
  constexpr int kSide = 256;  // An even grid, but not one of midpoints: good to 1/kSide.
  for (int c = 0; c < cells.count(); c += std::max(1, cells.count() / 7)) {
    const DirectionCell& cell = cells.cell(c);
    Vec3d direction(0.0), rotation(0.0);
    for (int i = 0; i < kSide * kSide; ++i) {
      const Vec3d w = cells.direction(c, {(i % kSide + 0.5) / kSide, (i / kSide + 0.5) / kSide});
      EXPECT_NEAR(w.length(), 1, 1e-12);
      direction += w * (cell.measure / (kSide * kSide));
      rotation += Vec3d(-w.y, w.x, 0) * (cell.measure / (kSide * kSide) / w.z);
    }
    EXPECT_NEAR((direction - cell.direction).length(), 0, 1e-2 * cell.measure) << "cell " << c;
    if (reaches_horizon(cells, c)) continue;
    EXPECT_NEAR((rotation - cell.rotation).length(), 0, 2e-2 * cell.measure) << "cell " << c;
  }
}

// Each wall has two sides, and the moments around a cell add up to what Stokes' theorem makes of
// them.
TEST_P(Cells, AreEnclosedByTheirWalls) {
  const DirectionCells cells(GetParam());
  std::vector<int> seen(cells.side_count());
  std::vector<Vec3d> around(cells.count(), Vec3d(0.0));
  for (const CellWall& wall : cells.walls()) {
    ++seen[wall.low_side];
    ++seen[wall.high_side];
    EXPECT_GE(wall.low_side, cells.cell(wall.low).first_side);
    EXPECT_LT(wall.low_side, cells.cell(wall.low).end_side);
    EXPECT_GE(wall.high_side, cells.cell(wall.high).first_side);
    EXPECT_LT(wall.high_side, cells.cell(wall.high).end_side);
    EXPECT_NEAR(wall.middle.length(), 1, 1e-12);
    around[wall.low] += wall.moment;   // Points out of it,
    around[wall.high] -= wall.moment;  // and into this one.
  }
  for (const int times : seen) EXPECT_EQ(times, 1);
  // Moments are int cos (outward normal) dl, so around a cell they sum to int (n - 3 cos w) dw. At
  // the horizon, where there is no wall, cos is 0.
  for (int c = 0; c < cells.count(); ++c) {
    const DirectionCell& cell = cells.cell(c);
    EXPECT_NEAR(around[c].x, -3 * cell.direction.x, 1e-12) << "cell " << c;
    EXPECT_NEAR(around[c].y, -3 * cell.direction.y, 1e-12) << "cell " << c;
    if (reaches_horizon(cells, c)) continue;
    double solid_angle = 0;  // int cos dw / cos.
    constexpr int kSide = 4096;
    for (int i = 0; i < kSide; ++i)
      solid_angle += cell.measure / kSide / cells.direction(c, {(i + 0.5) / kSide, 0.5}).z;
    EXPECT_NEAR(around[c].z, solid_angle - 3 * cell.direction.z, 2e-3 * solid_angle)
        << "cell " << c;
  }
}

INSTANTIATE_TEST_SUITE_P(OfEveryNumber, Cells, testing::Values(1, 2, 7, 100, 800, 3232));

class SphereCells : public testing::TestWithParam<int> {};

TEST_P(SphereCells, FillTheSphere) {
  const DirectionCells cells(GetParam(), DirectionDomain::Sphere);
  ASSERT_EQ(cells.count(), std::max(6, GetParam()));
  double measure = 0;
  Vec3d direction(0.0);
  for (int c = 0; c < cells.count(); ++c) {
    EXPECT_NEAR(cells.cell(c).measure, 4 * kPi / cells.count(), 1e-12);
    measure += cells.cell(c).measure;
    direction += cells.cell(c).direction;
  }
  EXPECT_NEAR(measure, cells.measure(), 1e-12);
  EXPECT_NEAR(direction.length(), 0, 1e-12);
}

TEST_P(SphereCells, HaveTheMomentsOfTheirDirections) {
  const DirectionCells cells(GetParam(), DirectionDomain::Sphere);
  constexpr int kSide = 128;
  for (int c = 0; c < cells.count(); c += std::max(1, cells.count() / 7)) {
    Vec3d direction(0.0);
    for (int i = 0; i < kSide * kSide; ++i)
      direction += cells.direction(c, {(i % kSide + 0.5) / kSide, (i / kSide + 0.5) / kSide}) *
                   (cells.cell(c).measure / (kSide * kSide));
    EXPECT_NEAR((direction - cells.cell(c).direction).length(), 0, 2e-2 * cells.cell(c).measure)
        << "cell " << c;
  }
}

// Moments are int (outward normal) dl, so around a cell they sum to -2 int w dw.
TEST_P(SphereCells, AreEnclosedByTheirWalls) {
  const DirectionCells cells(GetParam(), DirectionDomain::Sphere);
  std::vector<Vec3d> around(cells.count(), Vec3d(0.0));
  for (const CellWall& wall : cells.walls()) {
    around[wall.low] += wall.moment;
    around[wall.high] -= wall.moment;
    EXPECT_NEAR(wall.middle.length(), 1, 1e-12);
  }
  for (int c = 0; c < cells.count(); ++c)
    EXPECT_NEAR((around[c] + cells.cell(c).direction * 2).length(), 0, 1e-12) << "cell " << c;
}

TEST_P(SphereCells, AreFoundByTheirDirections) {
  for (const DirectionDomain domain : {DirectionDomain::Sphere, DirectionDomain::Hemisphere}) {
    const DirectionCells cells(GetParam(), domain);
    for (int c = 0; c < cells.count(); ++c)
      EXPECT_EQ(cells.cell_at(cells.direction(c, {0.3, 0.6})), c);
  }
  EXPECT_LT(DirectionCells(50).cell_at({0.6, 0, -0.8}), 0);
}

INSTANTIATE_TEST_SUITE_P(Counts, SphereCells, testing::Values(1, 6, 50, 200, 800, 3232));

}  // namespace
}  // namespace brume
