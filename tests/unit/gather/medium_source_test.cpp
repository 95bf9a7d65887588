// What is drawn to ask for light stands for all that could be asked.
#include "gather/medium_source.h"

#include <gtest/gtest.h>

#include "support/smoky_rooms.h"

namespace brume {
namespace {

constexpr int kShells = 24;

struct ShellLight {
  RgbD direct, rescattered;
  RgbGradient directional;
};

// What one ray through smoke and coloured haze sends.
class OneRay : public testing::Test {
 protected:
  static Scene scene() {
    Scene s = test::smoky_room();
    s.volumes.push_back(test::haze({0.5, 0.3, 0.1}, RgbD(0.1), -0.3, test::kUnitBox));
    return s;
  }

  OneRay() : stage_(scene()), marcher_(stage_.world.medium(), {}) {
    scattered_ = stage_.bake(test::room_view(4, 4)).scattered;
    for (int i = 0; i <= kShells; ++i) boundaries_.push_back(kEnd * i / kShells);
    jitter_.assign(kShells, 0.4);
    MarchCounters counters;
    marcher_.march(ray_, boundaries_, kEnd, jitter_, true, counters);
    effects_ = plan_effects(stage_.world, 2, 2);
    effects_.scattering = false;
  }

  std::vector<ShellLight> shells(MediumSource& source, std::uint64_t seed) {
    Counters counters;
    RandomStream random(random_key(seed));
    source.begin();
    const int ray = source.add(marcher_.view(), ray_, boundaries_, kEnd, {shifts_}, random);
    source.finish(counters);
    std::vector<ShellLight> shells(kShells);
    for (const MediumLight& part : source.light(ray)) {
      ShellLight& shell = shells[static_cast<std::size_t>(part.shell)];
      (part.kind == MediumLight::Kind::Direct ? shell.direct : shell.rescattered) += part.light;
      shell.directional += part.directional;
    }
    return shells;
  }

  static constexpr double kEnd = 0.9;
  test::Stage stage_;
  std::shared_ptr<const IncidentField> scattered_;
  Effects effects_;
  ShellMarcher marcher_;
  Ray ray_{{0.5, 0.5, 0.95}, Vec3d(0.1, -0.05, -1).normalized()};
  std::vector<double> boundaries_, jitter_;
  const std::vector<float> shifts_ = std::vector<float>(kShells, 0.4f);
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

TEST_F(OneRay, DrawnShellsStandForAll) {
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
    const std::vector<ShellLight> light = shells(drawn, seed);
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
TEST_F(OneRay, AllAskWhereEnoughMay) {
  MediumSource all(stage_.lighting, effects_), many(stage_.lighting, effects_);
  all.use_scattered(scattered_.get());
  many.use_scattered(scattered_.get(), 1000);
  const std::vector<ShellLight> truth = shells(all, 1);
  const std::vector<ShellLight> light = shells(many, 2);
  for (int i = 0; i < kShells; ++i) EXPECT_EQ(light[i].rescattered, truth[i].rescattered) << i;
}

// One sample of each light from each shell, over many points on the lights, against a few.
TEST_F(OneRay, DrawnLampSamplesStandForAll) {
  effects_.scattering = true;
  for (const bool near : {false, true}) {
    MediumSource all(stage_.lighting, effects_, true), drawn(stage_.lighting, effects_, true);
    drawn.use_lamp_samples(3, near, RandomStream(random_key(9)));
    Mean truth, sum, truth_near, sum_near, slope, true_slope;
    for (int seed = 0; seed < 4000; ++seed) {
      const auto add = [&](MediumSource& source, Mean& whole, Mean& over_distance, Mean& turn) {
        double light = 0, near_light = 0, directional = 0;
        const std::vector<ShellLight> of = shells(source, static_cast<std::uint64_t>(seed));
        for (int i = 0; i < kShells; ++i) {
          light += of[i].direct.g;
          near_light += of[i].direct.g * 2 / (boundaries_[i] + boundaries_[i + 1]);
          directional += of[i].directional.g.x;
        }
        whole.add(light);
        over_distance.add(near_light);
        turn.add(directional);
      };
      add(all, truth, truth_near, true_slope);
      add(drawn, sum, sum_near, slope);
    }
    const auto expect_equal = [](const Mean& a, const Mean& b, const char* what) {
      EXPECT_NEAR(a.value(), b.value(), 4 * std::hypot(a.error(), b.error())) << what;
    };
    expect_equal(sum, truth, "light");
    expect_equal(sum_near, truth_near, "light over distance");
    expect_equal(slope, true_slope, "change with direction");
    EXPECT_GT(truth.value(), 0);
    EXPECT_LT(sum.error(), 0.02 * truth.value());
    if (near) {
      EXPECT_LT(sum_near.error(), 0.02 * truth_near.value());
    }
  }
}

}  // namespace
}  // namespace brume
