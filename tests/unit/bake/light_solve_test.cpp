// The sum over orders and its bound, against sums of many more orders.
#include "bake/light_solve.h"

#include <gtest/gtest.h>

#include "core/random.h"

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
    if (i % 16 == 0) row.reflected = RgbD(random.uniform(), 1, 0);
    if (i == 3) row.unreflected = RgbD(0.2);
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
      row.strata.push_back(s);
    }
    system.rows.push_back(row);
  }
  return system;
}

TEST(LightSolve, BoundsWhatIsLeftOutAtEveryRecord) {
  for (const double albedo : {0.3, 0.8, 0.95}) {
    System system = system_of(64, albedo, 7);
    const SurfaceTransport transport(system.cache, system.rows, 0, 2);
    const DeepSolution ended = solve_deep_light(transport, system.rows, 250);
    EXPECT_GT(ended.truncation_bound, 0) << albedo;
    EXPECT_LT(ended.truncation_bound, 1e-3);
    EXPECT_LT(ended.orders, 249);
    // Plain orders, ten times as many.
    DeepLight change, all;
    for (const DeepRow& row : system.rows) all.push_back(row.unreflected);
    change = all;
    for (int order = 1; order <= 10 * ended.orders; ++order) {
      change = transport.apply(change);
      for (std::size_t i = 0; i < all.size(); ++i) {
        if (order == 1) change[i] += system.rows[i].reflected;
        all[i] += change[i];
      }
    }
    double most = 0;
    for (std::size_t i = 0; i < all.size(); ++i)
      for (int c = 0; c < 3; ++c) {
        const double rest = all[i][c] - ended.light[i][c];
        EXPECT_LE(rest, ended.truncation_bound * ended.light[i][c] * (1 + 1e-9));
        if (ended.light[i][c] > 0) most = std::max(most, rest / ended.light[i][c]);
      }
    EXPECT_GT(most, 0.02 * ended.truncation_bound) << "the bound says nothing";
  }
}

TEST(LightSolve, AddsAsManyOrdersAsBouncesLeave) {
  System system = system_of(64, 0.8, 9);
  const SurfaceTransport transport(system.cache, system.rows, 0, 1);
  EXPECT_EQ(transport.stratum_count(), 64u * 8u);
  for (const int bounces : {1, 2, 5}) {
    const DeepSolution s = solve_deep_light(transport, system.rows, bounces);
    EXPECT_EQ(s.orders, bounces - 1);
    EXPECT_EQ(s.truncation_bound, 0);
    // `light` is the gather of `before`.
    const DeepLight again = transport.apply(s.before);
    for (std::size_t i = 0; i < again.size(); ++i)
      for (int c = 0; c < 3; ++c) {
        const DeepRow& row = system.rows[i];
        const double lamps = bounces > 1 ? row.reflected[c] : 0;
        EXPECT_NEAR(s.light[i][c], row.unreflected[c] + lamps + again[i][c], 1e-9);
      }
  }
}

TEST(LightSolve, GivesTheSameBitsForAnyThreadCount) {
  const auto solved = [](int threads) {
    System system = system_of(200, 0.9, 11);
    const SurfaceTransport transport(system.cache, system.rows, 0, threads);
    return solve_deep_light(transport, system.rows, 100).light;
  };
  EXPECT_EQ(solved(1), solved(3));
}

}  // namespace
}  // namespace brume
