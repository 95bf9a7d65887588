// Shells drawn to ask for light that scattered before stand for all of them.
#include "gather/medium_source.h"

#include <gtest/gtest.h>

#include "support/smoky_rooms.h"

namespace brume {
namespace {

constexpr int kShells = 24;

// What one ray through smoke and coloured haze sends, without light straight from lights.
class ScatteredAgain : public testing::Test {
 protected:
  static Scene scene() {
    Scene s = test::smoky_room();
    s.volumes.push_back(test::haze({0.5, 0.3, 0.1}, RgbD(0.1), -0.3, test::kUnitBox));
    return s;
  }

  ScatteredAgain() : stage_(scene()), marcher_(stage_.world.medium(), {}) {
    scattered_ = stage_.bake(test::room_view(4, 4)).scattered;
    for (int i = 0; i <= kShells; ++i) boundaries_.push_back(kEnd * i / kShells);
    jitter_.assign(kShells, 0.4);
    MarchCounters counters;
    marcher_.march(ray_, boundaries_, kEnd, jitter_, true, counters);
    effects_ = plan_effects(stage_.world, 2, 2);
    effects_.scattering = false;
  }

  const std::vector<ShellLight>& shells(MediumSource& source, std::uint64_t seed) {
    Counters counters;
    RandomStream random(random_key(seed));
    return source.shells(marcher_, ray_, boundaries_, kEnd, jitter_, random, counters);
  }

  static constexpr double kEnd = 0.9;
  test::Stage stage_;
  std::shared_ptr<const IncidentField> scattered_;
  Effects effects_;
  ShellMarcher marcher_;
  Ray ray_{{0.5, 0.5, 0.95}, Vec3d(0.1, -0.05, -1).normalized()};
  std::vector<double> boundaries_, jitter_;
};

// Sums of independent samples and what they are off.
struct Mean {
  double sum = 0, squares = 0;
  int count = 0;
  void add(double x) {
    sum += x;
    squares += x * x;
    ++count;
  }
  double value() const { return sum / count; }
  double error() const {
    return std::sqrt(std::max(0.0, squares / count - value() * value()) / (count - 1));
  }
};

TEST_F(ScatteredAgain, DrawnShellsStandForAll) {
  ASSERT_TRUE(scattered_);
  MediumSource all(stage_.lighting, effects_, true), drawn(stage_.lighting, effects_, true);
  all.use_scattered(scattered_.get());
  drawn.use_scattered(scattered_.get(), 4);
  const std::vector<ShellLight> truth = shells(all, 0);
  Mean green[kShells], sum, slope;
  RgbD true_sum;
  double true_slope = 0;
  for (const ShellLight& s : truth) {
    true_sum += s.rescattered;
    true_slope += luminance(s.directional).x;
  }
  ASSERT_GT(true_sum.g, 0);
  int asked = 0;
  for (int seed = 0; seed < 4000; ++seed) {
    const std::vector<ShellLight>& light = shells(drawn, seed);
    double of_ray = 0, slope_of_ray = 0;
    for (int i = 0; i < kShells; ++i) {
      green[i].add(light[i].rescattered.g);
      of_ray += light[i].rescattered.r;
      slope_of_ray += luminance(light[i].directional).x;
      asked += light[i].rescattered.g > 0;
    }
    sum.add(of_ray);
    slope.add(slope_of_ray);
  }
  EXPECT_LE(asked, 4 * 4000);
  EXPECT_NEAR(sum.value(), true_sum.r, 4 * sum.error());
  EXPECT_LT(sum.error(), 0.01 * true_sum.r);
  EXPECT_NEAR(slope.value(), true_slope, 4 * slope.error());
  for (int i = 0; i < kShells; ++i)
    EXPECT_NEAR(green[i].value(), truth[i].rescattered.g, 4.5 * green[i].error()) << i;
}

// Then nothing is drawn.
TEST_F(ScatteredAgain, AllAskWhereEnoughMay) {
  MediumSource all(stage_.lighting, effects_), many(stage_.lighting, effects_);
  all.use_scattered(scattered_.get());
  many.use_scattered(scattered_.get(), 1000);
  const std::vector<ShellLight> truth = shells(all, 1);
  const std::vector<ShellLight>& light = shells(many, 2);
  for (int i = 0; i < kShells; ++i) EXPECT_EQ(light[i].rescattered, truth[i].rescattered) << i;
}

}  // namespace
}  // namespace brume
