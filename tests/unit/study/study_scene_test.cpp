// What studies are made of: errors without the reference's noise, stops, and where Chart.js is.
#include "study/study_scene.h"

#include <gmock/gmock.h>

#include <atomic>
#include <filesystem>

#include "core/error.h"
#include "core/random.h"
#include "study/chart_library.h"

namespace brume {
namespace {

// Two estimates of the truth i / n with noise of the given size.
NoiseFreeError noisy(double offset, double noise, int n = 40000) {
  NoiseFreeError error;
  RandomStream random(7);
  for (int i = 0; i < n; ++i) {
    const double truth = 1 + double(i) / n;
    const auto estimate = [&] { return truth + noise * (random.uniform() - 0.5); };
    const double first = estimate(), second = estimate();
    error.add(truth + offset, first, second);
  }
  return error;
}

TEST(NoiseFreeError, IsFreeOfTheNoiseOfTheReference) {
  // Noise of variance 1/12 in each half would add 1/24 to a plain mean square.
  EXPECT_NEAR(noisy(0.1, 1).relative_rms(), 0.1 / 1.5, 0.01);
  EXPECT_NEAR(noisy(0, 1).relative_rms(), 0, 0.02);
  EXPECT_NEAR(noisy(0.1, 0).relative_rms(), 0.1 / 1.5, 1e-6);
}

TEST(NoiseFreeError, KnowsTheNoiseOfTheReference) {
  EXPECT_NEAR(noisy(0.3, 1).reference_noise(), std::sqrt(1.0 / 24) / 1.5, 0.002);
  EXPECT_EQ(noisy(0.3, 0).reference_noise(), 0);
}

TEST(NoiseFreeError, RelmseIsThatOfTheSpecificationWithoutNoise) {
  NoiseFreeError error;
  error.add(1.5, 1, 1);
  error.add(0, 3, 3);
  const double floor = 0.01 * 2;
  EXPECT_NEAR(error.relmse(), (0.25 / (1 + floor * floor) + 9 / (9 + floor * floor)) / 2, 1e-12);
}

TEST(NoiseFreeError, OfNothingOrOfBlackIsZero) {
  EXPECT_EQ(NoiseFreeError().relmse(), 0);
  NoiseFreeError black;
  black.add(0, 0, 0);
  EXPECT_EQ(black.relmse(), 0);
  EXPECT_EQ(black.relative_rms(), 0);
}

TEST(StudyRun, StopsWhenAsked) {
  std::atomic<int> done = 0;
  StudyRun run;
  run.threads = 2;
  run.stop_requested = [&] { return done >= 3; };
  try {
    run.each("stage", 1000, [&](std::size_t, int) { ++done; });
    FAIL() << "went on";
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::Stopped);
  }
  EXPECT_LT(done, 1000);
}

TEST(ChartLibrary, NamesThePackageWhereItIsMissing) {
  const std::filesystem::path empty = testing::TempDir() + "brume_no_charts";
  std::filesystem::create_directories(empty);
  try {
    load_chart_library({empty});
    FAIL() << "found";
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::Resource);
    EXPECT_THAT(e.what(), testing::HasSubstr("libjs-chart.js"));
  }
}

}  // namespace
}  // namespace brume
