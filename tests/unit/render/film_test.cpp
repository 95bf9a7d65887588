#include "render/film.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "core/random.h"

namespace brume {
namespace {

// Layers over nine orders of magnitude, which add up worst.
PixelFilm random_film(int width, int height) {
  PixelFilm film(width, height);
  RandomStream random(11);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      PixelResult& p = film.at(x, y);
      for (RgbD& layer : p.layers)
        for (int k = 0; k < 3; ++k) layer[k] = std::pow(10.0, random.uniform() * 9 - 6);
      p.alpha = random.uniform();
      p.z = x == 0 ? kInfinity : 1 + random.uniform();
      p.normal = {0, 0.6, 0.8};
      p.position = {double(x), double(y), -1};
      p.albedo = {0.5, 0.25, 0.125};
      p.cache_count = 3;
      p.cost = 100;
    }
  return film;
}

double worst_sum_error(bool half_colour) {
  const PixelFilm film = random_film(64, 64);
  FilmOptions options;
  options.half_colour = half_colour;
  const Image image = film.develop(options).image;
  const std::vector<Rgb> beauty = image.layer("");
  std::vector<RgbD> sum(beauty.size());
  for (int l = 0; l < kLayerCount; ++l) {
    const std::vector<Rgb> layer = image.layer(layer_name(static_cast<Layer>(l)));
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += RgbD(layer[i]);
  }
  double worst = 0;
  for (std::size_t i = 0; i < sum.size(); ++i)
    for (int k = 0; k < 3; ++k)
      worst = std::max(worst, std::abs(double(beauty[i][k]) - sum[i][k]) / sum[i][k]);
  return worst;
}

// SPEC, "Images"; the bounds here are what one rounding leaves.
TEST(PixelFilm, HalfLayersSumToBeauty) { EXPECT_LE(worst_sum_error(true), 0x1p-11); }
TEST(PixelFilm, FloatLayersSumToBeauty) { EXPECT_LE(worst_sum_error(false), 0x1p-24); }

TEST(PixelFilm, ChannelsComeInOrderAndWithTheirTypes) {
  const Image image = random_film(2, 2).develop({}).image;
  std::vector<std::string> names;
  for (const ImageChannel& c : image.channels) names.push_back(c.name);
  ASSERT_GE(names.size(), 4u + 27 + 15);
  EXPECT_THAT(std::vector<std::string>(names.begin(), names.begin() + 7),
              testing::ElementsAre("R", "G", "B", "A", "diffuse_direct.R", "diffuse_direct.G",
                                   "diffuse_direct.B"));
  EXPECT_THAT(std::vector<std::string>(names.begin() + 31, names.end()),
              testing::ElementsAre("Z", "N.X", "N.Y", "N.Z", "P.X", "P.Y", "P.Z", "albedo.R", "albedo.G",
                                   "albedo.B", "transmittance.R", "transmittance.G",
                                   "transmittance.B", "cache_count", "cost"));
  for (std::size_t i = 0; i < names.size(); ++i)
    EXPECT_EQ(image.channels[i].is_half, i < 31) << names[i];
}

TEST(PixelFilm, KeepsOnlyTheLayersAskedForAndTheSameBeauty) {
  const PixelFilm film = random_film(3, 2);
  FilmOptions options;
  options.aovs = {"beauty", "Z", "emission"};
  const Image some = film.develop(options).image, all = film.develop({}).image;
  EXPECT_THAT(some.layer_names(), testing::ElementsAre("", "Z", "emission"));
  EXPECT_EQ(some.layer(""), all.layer(""));
  EXPECT_EQ(some.layer("emission"), all.layer("emission"));
}

TEST(PixelFilm, RefusesAnUnknownLayer) {
  FilmOptions options;
  options.aovs = {"Z", "difuse_direct"};
  try {
    PixelFilm(1, 1).develop(options);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::Usage);
    EXPECT_THAT(e.what(), testing::HasSubstr("difuse_direct"));
    EXPECT_THAT(e.what(), testing::HasSubstr("diffuse_direct"));
  }
}

TEST(PixelFilm, BadValuesBecomeZeroInTheirLayerAndAreCountedByPixel) {
  PixelFilm film = random_film(4, 1);
  const double nan = std::nan("");
  film.at(0, 0)[Layer::Emission].g = nan;
  film.at(0, 0)[Layer::VolumeDirect].r = kInfinity;  // The same pixel: counted once.
  film.at(1, 0).cost = nan;
  film.at(2, 0)[Layer::Background].b = 1e300;  // Beyond float.
  const PixelFilm::Developed d = film.develop({});
  EXPECT_EQ(d.bad_pixels, 3u);
  EXPECT_EQ(d.image.layer("emission")[0], Rgb());
  EXPECT_EQ(d.image.layer("background")[2], Rgb());
  EXPECT_EQ(d.image.find("cost")->values[1], 0);
  EXPECT_GT(d.image.layer("diffuse_direct")[0].r, 0) << "other layers keep their values";
  for (const ImageChannel& c : d.image.channels)
    for (const float v : c.values) EXPECT_TRUE(std::isfinite(v)) << c.name;
}

TEST(PixelFilm, NoHitHasAFiniteDepthAndIsNotBad) {
  const PixelFilm::Developed d = random_film(2, 1).develop({});
  EXPECT_EQ(d.bad_pixels, 0u);
  EXPECT_EQ(d.image.find("Z")->values[0], kNoHitDepth);
}

TEST(PixelFilm, SubnormalHalvesStayNonNegativeAndBrightOnesAreClamped) {
  PixelFilm film(2, 1);
  film.at(0, 0)[Layer::Emission] = RgbD(1e6);
  film.at(1, 0)[Layer::Emission] = RgbD(1e-9);
  const Image image = film.develop({}).image;
  EXPECT_EQ(image.layer("emission")[0], Rgb(65504.0f));
  EXPECT_EQ(image.layer("")[0], Rgb(65504.0f));
  EXPECT_EQ(image.layer("emission")[1], Rgb(0.0f)) << "below the smallest half";
}

}  // namespace
}  // namespace brume
