#include "cli/values.h"

#include <gtest/gtest.h>

#include "cli/nearest_name.h"
#include "cli/outputs.h"
#include "core/error.h"

namespace brume {
namespace {

TEST(Values, SizesTakePowersOf1024) {
  EXPECT_EQ(parse_bytes("-m", "1000"), 1000u);
  EXPECT_EQ(parse_bytes("-m", "4G"), 4ull << 30);
  EXPECT_EQ(parse_bytes("-m", "1.5GiB"), 3ull << 29);
  EXPECT_EQ(parse_bytes("-m", "512MB"), 512ull << 20);
  for (const char* bad : {"", "G", "-1", "0", "1GG", "1iB", "nan", "1e30T", "4 G"})
    EXPECT_THROW(parse_bytes("-m", bad), CLI::ValidationError) << bad;
}

TEST(Values, LengthsNameTheirUnit) {
  EXPECT_DOUBLE_EQ(parse_length("-m", "5mm"), 0.005);
  EXPECT_DOUBLE_EQ(parse_length("-m", "2.5cm"), 0.025);
  EXPECT_DOUBLE_EQ(parse_length("-m", "1e-3m"), 0.001);
  EXPECT_DOUBLE_EQ(parse_length("-m", "3km"), 3000);
  // A bare number was a part of the scene's diagonal once.
  for (const char* bad : {"", "m", "0.002", "0m", "-1m", "1 m", "1ft", "infm", "nanm", "1e999m"})
    EXPECT_THROW(parse_length("-m", bad), CLI::ValidationError) << bad;
}

TEST(Values, CropsWithADecimalPointAreFractions) {
  const CropRegion pixels = parse_crop("--crop", "0,0,1,1");
  EXPECT_TRUE(pixels.is_pixels);
  const CropRegion fractions = parse_crop("--crop", "0.25,0,0.5,1");
  EXPECT_FALSE(fractions.is_pixels);
  EXPECT_EQ(fractions.x0, 0.25);
  EXPECT_EQ(fractions.y1, 1);
}

TEST(Values, NumbersAreWhole) {
  EXPECT_EQ(parse_number("-x", "+1.5", 0, 2), 1.5);
  for (const char* bad : {"", "1.5x", " 1", "nan", "inf", "3", "-0.1", "1,5"})
    EXPECT_THROW(parse_number("-x", bad, 0, 2), CLI::ValidationError) << bad;
}

TEST(NearestName, FindsTyposAndSwaps) {
  const std::vector<std::string> known{"render", "bake", "inspect"};
  EXPECT_EQ(nearest_name("redner", known), "render");
  EXPECT_EQ(nearest_name("bkae", known), "bake");
  EXPECT_EQ(nearest_name("inspct", known), "inspect");
  EXPECT_EQ(nearest_name("photograph", known), std::nullopt);
  EXPECT_EQ(nearest_name("", known), std::nullopt);
}

TEST(FrameNumbers, FillRunsOfHashes) {
  EXPECT_EQ(with_frame("a.####.exr", 7), "a.0007.exr");
  EXPECT_EQ(with_frame("a.######.exr", 7), "a.000007.exr");
  EXPECT_EQ(with_frame("a.####.exr", 123456), "a.123456.exr");
  EXPECT_EQ(with_frame("a.exr", 7), "a.exr");
  EXPECT_EQ(with_frame("a#1.exr", std::nullopt), "a#1.exr");
  EXPECT_THROW(with_frame("a.####.exr", std::nullopt), Error);
}

}  // namespace
}  // namespace brume
