// Sums of scatterings on a row of records that each scatter to their two neighbours: nearly white
// and long, so that plain terms take thousands.
#include "bake/scattering_solve.h"

#include <gtest/gtest.h>

#include "plan/effects.h"
#include "scene/world.h"

namespace brume {
namespace {

constexpr int kRecords = 40;

struct Chain {
  explicit Chain(double albedo) {
    VolumeRecords records;
    std::vector<DeepRow> none;
    for (int i = 0; i < kRecords; ++i) {
      VolumeRecord r{};
      r.position[0] = static_cast<float>(i);
      std::fill_n(r.radius, 3, 0.25f);
      r.axes[0] = 1;
      r.clearance = 10;
      r.key = static_cast<std::uint64_t>(i);
      const VolumeMoment m{};
      records.push_back(r, {&m, 1});
      DeepRow row;
      row.unreflected = {RgbD()};
      row.reflected = {RgbD()};
      for (const int side : {-1, 1}) {
        if (i + side < 0 || i + side >= kRecords) continue;
        Stratum s{};
        s.direction[0] = static_cast<float>(side);
        s.measure = static_cast<float>(2 * kPi);
        const auto w = static_cast<float>(albedo);
        row.strata.points.push_back({1, 0, {w, 0.5f * w, w}});
        s.points_end = static_cast<std::uint32_t>(row.strata.points.size());
        row.strata.strata.push_back(s);
      }
      rows.push_back(row);
    }
    const IrradianceCache cache({}, Vec3d(0.0), {},
                                std::make_shared<VolumeCache>(records, Vec3d(0.0)));
    transport = std::make_unique<LightTransport>(World(Scene{}), cache, none, rows, 2);
  }
  std::vector<RgbD> plain(const std::vector<RgbD>& source, int terms) const {
    std::vector<RgbD> sum = source, term = source;
    for (int i = 0; i < terms; ++i) {
      term = transport->scatter(term);
      for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += term[k];
    }
    return sum;
  }

  std::vector<DeepRow> rows;
  std::unique_ptr<LightTransport> transport;
};

std::vector<RgbD> light_at_one_end() {
  std::vector<RgbD> source(kRecords);
  source[0] = RgbD(1, 2, 0.5);
  return source;
}

TEST(ScatteringSolve, AcceleratedSumsAreWithinTheirBound) {
  const Chain chain(0.999);
  const std::vector<RgbD> truth = chain.plain(light_at_one_end(), 20000);
  const int before = chain.transport->applications();
  ScatteringSolve solve(*chain.transport, kEveryOrder, 1e-4);
  std::vector<RgbD> surface;
  const std::vector<RgbD> sum = solve.sum(light_at_one_end(), surface);
  EXPECT_TRUE(solve.is_accelerated());
  EXPECT_LT(chain.transport->applications() - before, 150);
  EXPECT_LT(solve.bound(), 1e-4);
  for (int c = 0; c < 3; ++c) {
    double mean = 0;
    for (const RgbD& m : truth) mean += m[c] / kRecords;
    for (int i = 0; i < kRecords; ++i)
      EXPECT_NEAR(sum[i][c], truth[i][c], solve.bound() * std::max(truth[i][c], 0.1 * mean) * 1.001)
          << i;
  }
}

TEST(ScatteringSolve, FastOnesAreSummedPlainlyWithinTheirBound) {
  const Chain chain(0.4);
  const std::vector<RgbD> truth = chain.plain(light_at_one_end(), 500);
  ScatteringSolve solve(*chain.transport, kEveryOrder, 1e-3);
  std::vector<RgbD> surface;
  // Light at every record: at places that none has reached yet nothing is bounded.
  std::vector<RgbD> source = light_at_one_end();
  for (RgbD& s : source) s += RgbD(0.1);
  const std::vector<RgbD> even = chain.plain(source, 500), sum = solve.sum(source, surface);
  EXPECT_FALSE(solve.is_accelerated());
  EXPECT_LT(solve.orders(), 40);
  for (int i = 0; i < kRecords; ++i)
    for (int c = 0; c < 3; ++c) {
      EXPECT_LE(sum[i][c], even[i][c] * (1 + 1e-9));
      EXPECT_GE(sum[i][c] * (1 + solve.bound()), even[i][c] * (1 - 1e-9));
    }
  EXPECT_GT(solve.bound(), 0);
  EXPECT_LT(solve.bound(), 1e-3);
}

TEST(ScatteringSolve, AddsAsManyTermsAsAskedFor) {
  const Chain chain(0.8);
  for (const int limit : {0, 1, 2, 5}) {
    ScatteringSolve solve(*chain.transport, limit, 1e-12);
    std::vector<RgbD> surface;
    const std::vector<RgbD> sum = solve.sum(light_at_one_end(), surface);
    const std::vector<RgbD> expected =
        limit == 0 ? std::vector<RgbD>(kRecords) : chain.plain(light_at_one_end(), limit - 1);
    for (int i = 0; i < kRecords; ++i) EXPECT_NEAR(sum[i].g, expected[i].g, 1e-12) << limit;
  }
}

}  // namespace
}  // namespace brume
