#include "study/metrics.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <functional>

#include "core/error.h"
#include "core/image.h"
#include "core/random.h"
#include "study/flip.h"

namespace brume {
namespace {

std::vector<Rgb> constant(int pixels, const Rgb& c) { return std::vector<Rgb>(std::size_t(pixels), c); }

std::vector<Rgb> noise(int pixels, std::uint64_t seed) {
  RandomStream random(seed);
  std::vector<Rgb> image(static_cast<std::size_t>(pixels));
  for (Rgb& c : image)
    c = {float(random.uniform()), float(random.uniform()), float(random.uniform())};
  return image;
}

double mean_flip(const std::vector<Rgb>& a, const std::vector<Rgb>& b, int width, int height) {
  double sum = 0;
  for (const float f : flip_map(a, b, width, height)) {
    EXPECT_GE(f, 0);
    EXPECT_LE(f, 1);
    sum += f;
  }
  return sum / double(a.size());
}

TEST(ImageDifference, FollowsItsDefinitions) {
  // Luminances 1, 3, 2, 2 against 2, 2, 2, 2.
  const std::vector<Rgb> a{Rgb(1.0f), Rgb(3.0f), Rgb(2.0f), Rgb(2.0f)}, b = constant(4, Rgb(2.0f));
  const DifferenceMap map = compare_images(a, b, 2, 2);
  const ImageDifference& n = map.numbers;
  EXPECT_NEAR(n.mae, 0.5, 1e-12);
  EXPECT_NEAR(n.rmse, std::sqrt(0.5), 1e-12);
  EXPECT_NEAR(n.relmse, 0.5 / (4 + 0.02 * 0.02), 1e-12);
  EXPECT_NEAR(n.signed_mean, 0, 1e-12);
  EXPECT_NEAR(n.max, 1, 1e-12);
  EXPECT_NEAR(map.relative[0], -1 / std::sqrt(4.0004), 1e-6);
  EXPECT_NEAR(map.relative[1], 1 / std::sqrt(4.0004), 1e-6);
  EXPECT_EQ(map.relative[2], 0);
}

TEST(ImageDifference, UsesLuminance) {
  const DifferenceMap map = compare_images(constant(4, Rgb(2, 1, 1)), constant(4, Rgb(1, 1, 1)), 2, 2);
  EXPECT_NEAR(map.numbers.mae, 0.2126, 1e-9);
  EXPECT_NEAR(map.numbers.signed_mean, 0.2126, 1e-9);
}

TEST(ImageDifference, The99thPercentileIsByNearestRank) {
  std::vector<Rgb> a(200, Rgb(1.0f));
  a[3] = Rgb(101.0f), a[77] = Rgb(51.0f), a[100] = Rgb(11.0f);
  // 198 of 200 pixels are at most 10 off.
  EXPECT_NEAR(compare_images(a, constant(200, Rgb(1.0f)), 20, 10).numbers.p99, 10, 1e-5);
}

TEST(ImageDifference, EqualImagesDifferByNothing) {
  const std::vector<Rgb> image = noise(32 * 16, 1);
  const DifferenceMap map = compare_images(image, image, 32, 16);
  const ImageDifference& n = map.numbers;
  for (const double v : {n.mae, n.rmse, n.max, n.p99, n.relmse, n.signed_mean, n.flip}) EXPECT_EQ(v, 0);
}

TEST(ImageDifference, ABlackReferenceGivesZeroOrInfinity) {
  const std::vector<Rgb> black = constant(4, Rgb()), grey = constant(4, Rgb(0.5f));
  const ImageDifference same = compare_images(black, black, 2, 2).numbers;
  EXPECT_EQ(same.relmse, 0);
  EXPECT_EQ(same.signed_mean, 0);
  EXPECT_EQ(same.flip, 0);
  const ImageDifference other = compare_images(grey, black, 2, 2).numbers;
  EXPECT_EQ(other.relmse, kInfinity);
  EXPECT_EQ(other.signed_mean, kInfinity);
  EXPECT_TRUE(std::isfinite(other.flip));
}

TEST(ImageDifference, RefusesOtherSizesAndValuesThatAreNotFinite) {
  EXPECT_THROW(compare_images(constant(4, Rgb()), constant(6, Rgb()), 2, 2), Error);
  EXPECT_THROW(compare_images({}, {}, 0, 0), Error);
  std::vector<Rgb> bad = constant(4, Rgb(1.0f));
  bad[3].g = std::numeric_limits<float>::quiet_NaN();
  try {
    compare_images(constant(4, Rgb(1.0f)), bad, 2, 2);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
    EXPECT_NE(std::string(e.what()).find("(1, 1)"), std::string::npos) << e.what();
  }
}

TEST(BlockNrmse, AveragesNoiseOutAndKeepsBias) {
  constexpr int kSide = 128;
  const std::vector<Rgb> b = constant(kSide * kSide, Rgb(1.0f));
  std::vector<Rgb> a = noise(kSide * kSide, 5);
  for (Rgb& c : a) c = Rgb(0.6f + c.r);  // Mean 1.1, standard deviation 1 / sqrt(12).
  const double per_pixel = block_nrmse(a, b, kSide, kSide, 1), blocks = block_nrmse(a, b, kSide, kSide, 8);
  EXPECT_NEAR(per_pixel, std::sqrt(1.0 / 12 + 0.01), 0.005);
  EXPECT_NEAR(blocks, std::sqrt(1.0 / 12 / 64 + 0.01), 0.005);
  EXPECT_NEAR(per_pixel, compare_images(a, b, kSide, kSide).numbers.rmse, 1e-9);
  EXPECT_THROW(block_nrmse(a, b, kSide, kSide, 129), Error);
}

TEST(Flip, BlackAgainstWhite) {
  // Without structure the filters do nothing, so the value follows from the formulae: HyAB is 100 and
  // cmax = HyAB(green, blue)^0.7.
  const double flip = mean_flip(constant(400, Rgb()), constant(400, Rgb(1.0f)), 20, 20);
  EXPECT_NEAR(flip, 0.9674, 5e-4);
}

TEST(Flip, GreenAgainstBlueIsTheLargestDifference) {
  EXPECT_NEAR(mean_flip(constant(400, Rgb(0, 1, 0)), constant(400, Rgb(0, 0, 1)), 20, 20), 1, 1e-6);
}

TEST(Flip, IsSymmetric) {
  const std::vector<Rgb> a = noise(40 * 30, 2), b = noise(40 * 30, 3);
  EXPECT_EQ(flip_map(a, b, 40, 30), flip_map(b, a, 40, 30));
  EXPECT_GT(mean_flip(a, b, 40, 30), 0.05);
}

TEST(Flip, ClampsToTheDisplay) {
  EXPECT_EQ(mean_flip(constant(400, Rgb(5.0f)), constant(400, Rgb(1.0f)), 20, 20), 0);
  EXPECT_EQ(mean_flip(constant(400, Rgb(-5.0f)), constant(400, Rgb(0.0f)), 20, 20), 0);
}

// Fine noise is below the eye's resolution, the same contrast in patches is not.
TEST(Flip, FineDetailCountsForLessThanCoarse) {
  const auto stripes = [](int period) {
    std::vector<Rgb> image(96 * 96);
    for (int i = 0; i < 96 * 96; ++i) image[std::size_t(i)] = Rgb((i % 96) / period % 2 ? 0.5f : 0.3f);
    return image;
  };
  std::vector<Rgb> grey = constant(96 * 96, Rgb(0.4f));
  EXPECT_LT(mean_flip(stripes(1), grey, 96, 96), 0.5 * mean_flip(stripes(8), grey, 96, 96));
}

TEST(Flip, AnEdgeStandsOutWhereItIs) {
  std::vector<Rgb> a = constant(96 * 96, Rgb(0.4f)), b = a;
  for (int y = 0; y < 96; ++y)
    for (int x = 48; x < 52; ++x) a[std::size_t(y * 96 + x)] = Rgb(0.8f);
  const std::vector<float> map = flip_map(a, b, 96, 96);
  const float at = map[48 * 96 + 50], far = map[48 * 96 + 5];
  EXPECT_GT(at, 0.3f);
  EXPECT_LT(far, 1e-3f);
  // Features raise the error above that of the colour difference alone.
  const float flat = flip_map(constant(96 * 96, Rgb(0.8f)), b, 96, 96)[48 * 96 + 50];
  EXPECT_GT(map[48 * 96 + 48], 0.6f * flat);
}

TEST(Flip, IsTheSameTurnedByNinetyDegrees) {
  const int n = 40;
  const std::vector<Rgb> a = noise(n * n, 7), b = noise(n * n, 8);
  const auto turned = [n](const std::vector<Rgb>& in) {
    std::vector<Rgb> out(in.size());
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) out[std::size_t(x * n + y)] = in[std::size_t(y * n + x)];
    return out;
  };
  const std::vector<float> map = flip_map(a, b, n, n), other = flip_map(turned(a), turned(b), n, n);
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x)
      EXPECT_NEAR(map[std::size_t(y * n + x)], other[std::size_t(x * n + y)], 1e-6);
}

// Two independent programs' images of one scene; what their README says of them.
TEST(ReferenceImages, AgreeAsDocumented) {
  const std::filesystem::path folder = std::filesystem::path(BRUME_SHARED_DATA) / "reference";
  const auto a_file = folder / "smoky_box_pbrt_384spp.exr", b_file = folder / "smoky_box_mitsuba_3072spp.exr";
  if (!std::filesystem::exists(a_file) || !std::filesystem::exists(b_file))
    GTEST_SKIP() << folder << " is not here";
  Image a_image = read_image(a_file).image, b_image = read_image(b_file).image;
  const int w = a_image.width, h = a_image.height;
  ASSERT_EQ(w, 256);
  std::vector<Rgb> a = a_image.layer(""), b = b_image.layer("");
  // The lamp: x in (.41, .59), y in (.085, .145) of the image.
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      if ((x + 0.5) / w > 0.41 && (x + 0.5) / w < 0.59 && (y + 0.5) / h > 0.085 && (y + 0.5) / h < 0.145)
        a[std::size_t(y) * w + x] = b[std::size_t(y) * w + x] = Rgb();
  EXPECT_NEAR(block_nrmse(a, b, w, h, 8), 0.016, 0.002);
  const ImageDifference n = compare_images(a, b, w, h).numbers;
  EXPECT_NEAR(n.signed_mean, 0.00014, 0.00005);
  EXPECT_GT(n.flip, 0.01);
  EXPECT_LT(n.flip, 0.2);
}

}  // namespace
}  // namespace brume
