// The sum over orders and its bound, against sums of many more orders.
#include "bake/light_solve.h"

#include <gtest/gtest.h>

#include "core/random.h"
#include "support/scene_builder.h"

namespace brume {
namespace {

// Records in a row that see some others, each at its very place, and reflect `albedo` of it.
struct System {
  IrradianceCache cache;
  std::vector<DeepRow> rows;
};

System system_of(int count, double albedo, std::uint64_t seed) {
  RandomStream random(random_key(seed));
  std::vector<SurfaceRecord> records;
  for (int i = 0; i < count; ++i) {
    SurfaceRecord r{};
    r.position[0] = static_cast<float>(i);
    r.normal[2] = 1;
    r.radius[0] = r.radius[1] = 0.25f;
    r.key = static_cast<std::uint64_t>(i);
    records.push_back(r);
  }
  System system{IrradianceCache(records, Vec3d(0.0)), {}};
  for (int i = 0; i < count; ++i) {
    DeepRow row;
    // Light at a few of them only: the others see it after a while.
    row.reflected = {i % 16 == 0 ? RgbD(random.uniform(), 1, 0) : RgbD()};
    row.unreflected = {i == 3 ? RgbD(0.2) : RgbD()};
    const int seen = 8;
    for (int k = 0; k < seen; ++k) {
      const int to = std::min(count - 1, static_cast<int>(random.uniform() * count));
      Stratum s{};
      s.distance = static_cast<float>(std::abs(to - i));
      s.direction[0] = to < i ? -1.0f : 1.0f;
      s.normal[2] = 1;
      s.measure = static_cast<float>(kPi / seen);
      for (int c = 0; c < 3; ++c)
        s.reflectance[c] = static_cast<float>(albedo * (0.5 + 0.5 * random.uniform()) * kInvPi);
      row.strata.strata.push_back(s);
    }
    system.rows.push_back(row);
  }
  return system;
}

struct Solved {
  System system;
  std::vector<DeepRow> no_medium;
  LightTransport transport;

  Solved(int count, double albedo, std::uint64_t seed, int threads)
      : system(system_of(count, albedo, seed)),
        transport(World(Scene{}), system.cache, system.rows, no_medium, threads) {}
  DeepSolution solve(int bounces) const {
    return solve_deep_light(transport, system.rows, no_medium, bounces, 1);
  }
  std::vector<RgbD> reflect(const std::vector<RgbD>& light) const {
    return transport.reflect(light).surface;
  }
};

TEST(LightSolve, BoundsWhatIsLeftOutAtEveryRecord) {
  for (const double albedo : {0.3, 0.8, 0.95}) {
    const Solved solved(64, albedo, 7, 2);
    const DeepSolution ended = solved.solve(250);
    EXPECT_GT(ended.truncation_bound, 0) << albedo;
    EXPECT_LT(ended.truncation_bound, 1e-3);
    EXPECT_LT(ended.orders, 249);
    // Plain orders, ten times as many.
    std::vector<RgbD> change, all;
    for (const DeepRow& row : solved.system.rows) all.push_back(row.unreflected[0]);
    change = all;
    for (int order = 1; order <= 10 * ended.orders; ++order) {
      change = solved.reflect(change);
      for (std::size_t i = 0; i < all.size(); ++i) {
        if (order == 1) change[i] += solved.system.rows[i].reflected[0];
        all[i] += change[i];
      }
    }
    double most = 0;
    for (std::size_t i = 0; i < all.size(); ++i)
      for (int c = 0; c < 3; ++c) {
        const double light = ended.light.surface[i][c], rest = all[i][c] - light;
        EXPECT_LE(rest, ended.truncation_bound * light * (1 + 1e-9));
        if (light > 0) most = std::max(most, rest / light);
      }
    EXPECT_GT(most, 0.02 * ended.truncation_bound) << "the bound says nothing";
  }
}

TEST(LightSolve, AddsAsManyOrdersAsBouncesLeave) {
  const Solved solved(64, 0.8, 9, 1);
  EXPECT_EQ(solved.transport.stratum_count(), 64u * 8u);
  for (const int bounces : {1, 2, 5}) {
    const DeepSolution s = solved.solve(bounces);
    EXPECT_EQ(s.orders, bounces - 1);
    EXPECT_EQ(s.truncation_bound, 0);
    // `light` is the gather of `before`.
    const std::vector<RgbD> again = solved.reflect(s.before);
    for (std::size_t i = 0; i < again.size(); ++i)
      for (int c = 0; c < 3; ++c) {
        const DeepRow& row = solved.system.rows[i];
        const double lamps = bounces > 1 ? row.reflected[0][c] : 0;
        EXPECT_NEAR(s.light.surface[i][c], row.unreflected[0][c] + lamps + again[i][c], 1e-9);
      }
  }
}

TEST(LightSolve, GivesTheSameBitsForAnyThreadCount) {
  const auto light = [](int threads) {
    return Solved(200, 0.9, 11, threads).solve(100).light.surface;
  };
  EXPECT_EQ(light(1), light(3));
}

TEST(LightSolve, RowsComeBackFromTheirBytes) {
  System system = system_of(4, 0.5, 3);
  DeepRow& row = system.rows[0];
  row.strata.points.push_back({1.5f, 2, {0.1f, 0.2f, 0.3f}});
  row.strata.strata.back().points_end = 1;
  std::vector<unsigned char> bytes = bytes_of(row);
  bytes.resize(bytes.size() + 40);  // As a journal pads them.
  const std::optional<DeepRow> back = row_of(bytes);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->unreflected, row.unreflected);
  EXPECT_EQ(back->strata.strata.size(), row.strata.strata.size());
  EXPECT_EQ(bytes_of(*back), bytes_of(row));
  for (std::size_t n = 0; n < bytes_of(row).size(); n += 7)
    EXPECT_FALSE(row_of(std::span(bytes).first(n))) << n;
  row.strata.strata[0].points_end = 9;
  EXPECT_FALSE(row_of(bytes_of(row)));
}

TEST(LightSolve, SolutionsComeBackFromTheirBytes) {
  const Solved solved(50, 0.8, 4, 1);
  const DeepSolution solution = solved.solve(100);
  std::vector<unsigned char> bytes = bytes_of(solution);
  const std::size_t size = bytes.size();
  bytes.resize(size + 40);  // As a journal pads them.
  const std::optional<DeepSolution> back = solution_of(bytes);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->light.surface, solution.light.surface);
  EXPECT_EQ(back->before, solution.before);
  EXPECT_EQ(back->changes, solution.changes);
  EXPECT_EQ(back->orders, solution.orders);
  EXPECT_EQ(back->truncation_bound, solution.truncation_bound);
  EXPECT_EQ(bytes_of(*back), bytes_of(solution));
  for (std::size_t n = 0; n < size; n += 7)
    EXPECT_FALSE(solution_of(std::span(bytes).first(n))) << n;
}

}  // namespace
}  // namespace brume
