// Estimates of what a gather is off, against what gathers with other random numbers differ by.
#include "gather/cell_noise.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "gather/gather.h"
#include "support/oracle.h"
#include "support/smoky_rooms.h"

namespace brume {
namespace {

std::vector<Vec3d> directions_of(const DirectionCells& cells, RandomStream& random) {
  const Vec2d shift = random.uniform2();
  std::vector<Vec3d> directions;
  for (int c = 0; c < cells.count(); ++c) directions.push_back(cells.direction(c, shift));
  return directions;
}

TEST(CellNoise, IsWhatIndependentNoiseMakesTheSumOff) {
  for (const DirectionDomain domain : {DirectionDomain::Hemisphere, DirectionDomain::Sphere}) {
    const DirectionCells cells(800, domain);
    const CellNoise noise(cells);
    RandomStream random(3);
    const auto directions = directions_of(cells, random);
    std::vector<double> values(800);
    double found = 0, right = 0;
    for (int round = 0; round < 20; ++round) {
      for (double& v : values) v = random.uniform();
      found += noise.variance(cells, directions, values) / 20;
    }
    for (int c = 0; c < cells.count(); ++c)
      right += cells.cell(c).measure * cells.cell(c).measure / 12;
    EXPECT_NEAR(found / right, 0.67, 0.04);
  }
}

TEST(CellNoise, IsLittleWhereLightChangesSmoothly) {
  const DirectionCells cells(800);
  const CellNoise noise(cells);
  RandomStream random(4);
  const auto directions = directions_of(cells, random);
  std::vector<double> values;
  for (const Vec3d& w : directions) values.push_back(1 + w.x - 0.5 * w.y);
  EXPECT_LT(std::sqrt(noise.variance(cells, directions, values)), 1e-3 * cells.measure());
}

TEST(CellNoise, OfFewCellsIsFinite) {
  for (const int count : {1, 2, 6}) {
    const DirectionCells cells(count);
    RandomStream random(5);
    const auto directions = directions_of(cells, random);
    const std::vector<double> values(static_cast<std::size_t>(cells.count()), 1.0);
    EXPECT_NEAR(CellNoise(cells).variance(cells, directions, values), 0, 1e-20);
  }
}

// Between gathers of other random numbers, at places all over a room with blocks, a quad, a lamp
// and smoke.
TEST(GatherError, IsCalibrated) {
  const test::LitWorld lit(test::smoky_room());
  Gatherer gatherer(lit.lighting, lit.effects, {});
  constexpr int kPlaces = 24, kSeeds = 12;
  double squares = 0;
  for (int i = 0; i < kPlaces; ++i) {
    const Vec3d p(0.05 + 0.9 * std::fmod(0.7549 * i, 1.0), 0,
                  0.05 + 0.9 * std::fmod(0.5698 * i, 1.0));
    double sum = 0, sum2 = 0, expected = 0;
    for (int s = 0; s < kSeeds; ++s) {
      Counters counters;
      const GatherPoint at{p, Vec3d(0, 1, 0), 1e-6, random_key(i, s)};
      const GatherResult g = gatherer.gather(at, {}, counters);
      const double e = luminance(g.irradiance);
      sum += e;
      sum2 += e * e;
      expected += g.error * g.error / kSeeds;
    }
    if (expected > 0) squares += (sum2 - sum * sum / kSeeds) / (kSeeds - 1) / expected / kPlaces;
  }
  EXPECT_GT(std::sqrt(squares), 0.8);
  EXPECT_LT(std::sqrt(squares), 1.25);
}

}  // namespace
}  // namespace brume
