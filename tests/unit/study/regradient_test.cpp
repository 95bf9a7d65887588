// Records with other gradients: everything else stays, bit for bit.
#include "study/regradient.h"

#include <gtest/gtest.h>

#include <cstring>

#include "support/smoky_rooms.h"

namespace brume {
namespace {

class Regradient : public testing::Test {
 protected:
  static BakeSettings settings() {
    BakeSettings s = test::coarse_settings(1);
    s.gather.cells_theta = 4;
    s.gather.cells_phi = 12;
    s.gather.shells = 6;
    s.min_radius = 0.07;
    return s;
  }
  static const StudyScene& scene() {
    static const StudyScene all(test::smoky_room(), settings(), run());
    return all;
  }
  static StudyRun run() {
    StudyRun r;
    r.threads = 2;
    return r;
  }
  static const IrradianceCache& cache() {
    static const BakeResult baked = [] {
      BakeRequest request;
      request.views = {test::room_view(40, 40)};
      request.threads = 2;
      return bake(scene().lighting(), scene().settings(), request, nullptr);
    }();
    return *baked.cache;
  }
  static const RegradientResult& result() {
    static const RegradientResult r = regradient(scene(), cache(), run());
    return r;
  }
  static const std::vector<SurfaceRecord>& top() {
    static const std::vector<SurfaceRecord> records = [] {
      std::vector<SurfaceRecord> all;
      for (const SurfaceRecord& r : cache().records())
        if (r.layer() == kTopLayer) all.push_back(r);
      return all;
    }();
    return records;
  }
};

TEST_F(Regradient, GathersWhatTheBakeGathered) {
  ASSERT_GT(top().size(), 50u);
  EXPECT_EQ(result().largest_change, 0);
  // The mode that the bake ran in gives its gradients again.
  const auto full = result().caches[3].records();
  ASSERT_EQ(full.size(), top().size());
  for (std::size_t i = 0; i < full.size(); ++i)
    EXPECT_EQ(std::memcmp(&full[i], &top()[i], sizeof full[i]), 0) << i;
}

TEST_F(Regradient, ChangesGradientsAlone) {
  for (std::size_t m = 0; m < kModeCount; ++m) {
    const auto records = result().caches[m].records();
    ASSERT_EQ(records.size(), top().size());
    double size = 0, difference = 0;
    for (std::size_t i = 0; i < records.size(); ++i) {
      SurfaceRecord r = records[i];
      for (int k = 0; k < 9; ++k) {
        size += std::abs(r.gradient[k]);
        difference += std::abs(r.gradient[k] - top()[i].gradient[k]);
      }
      std::copy(std::begin(top()[i].gradient), std::end(top()[i].gradient), r.gradient);
      std::copy(std::begin(top()[i].rotational), std::end(top()[i].rotational), r.rotational);
      EXPECT_EQ(std::memcmp(&r, &top()[i], sizeof r), 0) << gradient_mode_name(kGradientModes[m]);
    }
    EXPECT_EQ(size == 0, kGradientModes[m] == GradientMode::None);
    EXPECT_EQ(difference == 0, kGradientModes[m] == GradientMode::Full);
  }
}

TEST_F(Regradient, CostIsComparedInPairs) {
  const PairedCost cost =
      compare_gather_cost(scene(), cache(), GradientMode::Full, GradientMode::Full, 60, run());
  EXPECT_EQ(cost.pairs, kCostPairs);
  EXPECT_EQ(cost.gathers, 60u);
  EXPECT_LE(cost.low, cost.ratio);
  EXPECT_GE(cost.high, cost.ratio);
  // The same work on both sides; wide, since machines are shared.
  EXPECT_GT(cost.ratio, 0.7);
  EXPECT_LT(cost.ratio, 1.4);
}

}  // namespace
}  // namespace brume
