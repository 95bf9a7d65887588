#include "render/preview.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <functional>

#include "core/error.h"
#include "render/false_colour.h"
#include "render/film.h"

namespace brume {
namespace {

namespace fs = std::filesystem;
using Byte3 = std::array<std::uint8_t, 3>;

class PreviewTest : public testing::Test {
 protected:
  // The picture write_preview() makes, decoded to linear.
  Image preview(const Image& image, const PreviewOptions& options) {
    const fs::path file = fs::path(testing::TempDir()) / ("brume_preview_" + std::to_string(getpid()) + ".png");
    write_preview(file, image, options);
    const Image back = read_image(file).image;
    fs::remove(file);
    return back;
  }
};

Image colour_image(int width, int height, const std::function<float(int)>& value) {
  Image image;
  image.width = width;
  image.height = height;
  for (const char* name : {"R", "G", "B", "Z"}) {
    image.channels.push_back({name, false, {}});
    for (int i = 0; i < width * height; ++i) image.channels.back().values.push_back(value(i));
  }
  return image;
}

TEST_F(PreviewTest, MiddleGreyStaysAndBrighterIsBrighterWithoutClipping) {
  const Image image = colour_image(5, 1, [](int i) { return std::array{0.0f, 0.18f, 1.0f, 4.0f, 50.0f}[i]; });
  const std::vector<Rgb> shown = preview(image, {}).layer("");
  EXPECT_EQ(shown[0], Rgb(0.0f));
  EXPECT_NEAR(shown[1].g, 0.18, 0.003);
  EXPECT_LT(shown[1].g, shown[2].g);
  EXPECT_LT(shown[2].g, shown[3].g);
  EXPECT_LT(shown[3].g, 0.95f);
  EXPECT_NEAR(shown[4].g, 1, 1e-6);
}

TEST_F(PreviewTest, AutomaticExposureMakesTheLogAverageMiddleGrey) {
  // Log-average 100; black pixels do not count.
  const Image image = colour_image(3, 1, [](int i) { return std::array{0.0f, 50.0f, 200.0f}[i]; });
  PreviewOptions options;
  options.automatic_exposure = true;
  const std::vector<Rgb> shown = preview(image, options).layer("");
  const Image same = colour_image(3, 1, [](int i) { return std::array{0.0f, 0.09f, 0.36f}[i]; });
  const std::vector<Rgb> expected = preview(same, {}).layer("");
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(shown[i].r, expected[i].r, 1e-6) << i;
  options.exposure = 1;
  EXPECT_GT(preview(image, options).layer("")[1].r, shown[1].r);
}

TEST_F(PreviewTest, ABlackImageIsBlack) {
  PreviewOptions options;
  options.automatic_exposure = true;
  for (const Rgb& c : preview(colour_image(2, 2, [](int) { return 0.0f; }), options).layer(""))
    EXPECT_EQ(c, Rgb(0.0f));
}

TEST_F(PreviewTest, OneChannelLayersGetColoursAndALegend) {
  const Image image = colour_image(200, 10, [](int i) { return i % 200 == 7 ? kNoHitDepth : float(i % 200); });
  PreviewOptions options;
  options.layer = "Z";
  const Image shown = preview(image, options);
  EXPECT_GE(shown.width, 200);
  EXPECT_GT(shown.height, 10);
  const std::vector<Rgb> c = shown.layer("");
  const auto expect_colour = [&](const Rgb& got, const Byte3& want) {
    for (int k = 0; k < 3; ++k)
      EXPECT_NEAR(got[k], srgb_decoded(want[static_cast<std::size_t>(k)] / 255.0), 1e-4);
  };
  expect_colour(c[0], map_colour(ColourMap::Sequential, 0));
  expect_colour(c[199], map_colour(ColourMap::Sequential, 1));
  expect_colour(c[7], map_colour(ColourMap::Sequential, std::nan("")));
}

TEST_F(PreviewTest, DataColoursAreShownAsTheyAre) {
  PixelFilm film(2, 1);
  film.at(0, 0).albedo = {0.5, 0.25, 1};
  film.at(0, 0).normal = {0, 0, 1};
  film.at(1, 0).position = {1, 2, 3};
  const Image image = film.develop({}).image;
  PreviewOptions options;
  options.layer = "albedo";
  const Rgb albedo = preview(image, options).layer("")[0];
  EXPECT_NEAR(albedo.r, 0.5, 0.004);
  EXPECT_NEAR(albedo.g, 0.25, 0.004);
  options.layer = "N";
  const Rgb normal = preview(image, options).layer("")[0];
  EXPECT_NEAR(srgb_encoded(normal.r), 0.5, 0.004);
  EXPECT_NEAR(srgb_encoded(normal.b), 1.0, 0.004);
  options.layer = "P";
  const std::vector<Rgb> position = preview(image, options).layer("");
  EXPECT_LT(position[0].g, position[1].g);
  options.layer = "nothing";
  EXPECT_THROW(preview(image, options), Error);
}

TEST(FalseColour, SequentialIsViridisWithinTwoPercent) {
  // Entries 0, 64, 128, 192 and 255 of the published table.
  const std::pair<double, Byte3> table[] = {{0, {68, 1, 84}},
                                            {64 / 255.0, {59, 82, 139}},
                                            {128 / 255.0, {33, 145, 140}},
                                            {192 / 255.0, {94, 201, 98}},
                                            {1, {253, 231, 37}}};
  for (const auto& [t, want] : table) {
    const Byte3 got = map_colour(ColourMap::Sequential, t);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(got[k], want[k], 5) << t << " " << k;
  }
}

double lightness(const Byte3& c) {
  return luminance(RgbD(srgb_decoded(c[0] / 255.0), srgb_decoded(c[1] / 255.0), srgb_decoded(c[2] / 255.0)));
}

TEST(FalseColour, MapsAreMonotoneInLightness) {
  for (int i = 1; i <= 64; ++i) {
    EXPECT_GT(lightness(map_colour(ColourMap::Sequential, i / 64.0)),
              lightness(map_colour(ColourMap::Sequential, (i - 1) / 64.0)));
    const double now = lightness(map_colour(ColourMap::Diverging, i / 64.0));
    const double before = lightness(map_colour(ColourMap::Diverging, (i - 1) / 64.0));
    if (i <= 32) {
      EXPECT_GT(now, before) << i;
    } else {
      EXPECT_LT(now, before) << i;
    }
  }
}

TEST(FalseColour, DivergingIsBlueThenNeutralThenRed) {
  const Byte3 low = map_colour(ColourMap::Diverging, 0.25), middle = map_colour(ColourMap::Diverging, 0.5),
              high = map_colour(ColourMap::Diverging, 0.75);
  EXPECT_GT(low[2], low[0] + 60);
  EXPECT_GT(high[0], high[2] + 60);
  EXPECT_LE(std::abs(middle[0] - middle[2]), 3);
  EXPECT_EQ(map_colour(ColourMap::Diverging, 7), map_colour(ColourMap::Diverging, 1));
}

TEST(FalseColour, TextDrawsItsDotsAndStaysInside) {
  Picture picture(13, 9);
  draw_text(picture, 1, 1, "I", 1, {255, 255, 255});
  const auto lit = [&](int x, int y) { return picture.srgb[std::size_t(3) * (y * 13 + x)] == 255; };
  EXPECT_TRUE(lit(2, 1) && lit(3, 1) && lit(4, 1) && lit(3, 4));
  EXPECT_FALSE(lit(2, 4));
  draw_text(picture, 10, -3, "WWW", 3, {9, 9, 9});  // Mostly outside.
  EXPECT_EQ(text_width("AB", 2), 22);
}

TEST(FalseColour, NarrowImagesAreWidenedForTheirLegend) {
  const Picture p = false_colour(std::vector<float>(6, 1.0f), 3, 2, {ColourMap::Sequential, -1, 1, "cache_count"});
  EXPECT_GE(p.width, text_width("cache_count", 1));
  EXPECT_EQ(p.srgb.size(), std::size_t(3) * p.width * p.height);
}

}  // namespace
}  // namespace brume
