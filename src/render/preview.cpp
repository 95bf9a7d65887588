#include "render/preview.h"

#include <algorithm>
#include <functional>
#include <limits>

#include "core/error.h"
#include "render/false_colour.h"
#include "render/film.h"

namespace brume {
namespace {

constexpr double kMiddleGrey = 0.18;

// Log-average luminance [RSSF02, Eq. 1] over the pixels that are lit at all; a black surround must
// not pull the exposure up.
double log_average(const std::vector<Rgb>& colour) {
  double sum = 0;
  std::size_t lit = 0;
  for (const Rgb& c : colour) {
    const double l = luminance(RgbD(c));
    if (!(l > 0) || !std::isfinite(l)) continue;
    sum += std::log(l);
    ++lit;
  }
  return lit == 0 ? 0 : std::exp(sum / static_cast<double>(lit));
}

// [RSSF02, Eq. 4] with L_white 8, on each channel so that very bright colours go white, and scaled
// so that middle grey stays where it is.
double tone_mapped(double c) {
  constexpr double kGain = 1 / (1 - kMiddleGrey), kWhite = 8;
  const double x = kGain * std::max(0.0, c);
  return std::min(1.0, x * (1 + x / (kWhite * kWhite)) / (1 + x));
}

std::uint8_t srgb_byte(double linear) {
  return static_cast<std::uint8_t>(std::lround(255 * srgb_encoded(std::clamp(linear, 0.0, 1.0))));
}

Picture colour_picture(const std::vector<Rgb>& colour, int width, int height,
                       const std::function<RgbD(const RgbD&)>& map) {
  Picture picture(width, height);
  for (std::size_t i = 0; i < colour.size(); ++i) {
    const RgbD c = is_finite(colour[i]) ? map(RgbD(colour[i])) : RgbD(1.0, 0.0, 1.0);
    for (int k = 0; k < 3; ++k) picture.srgb[3 * i + static_cast<std::size_t>(k)] = srgb_byte(c[k]);
  }
  return picture;
}

// The value that `share` of the values do not exceed.
double quantile(std::vector<float>& finite, double share) {
  const auto at = finite.begin() + std::lround(share * static_cast<double>(finite.size() - 1));
  std::nth_element(finite.begin(), at, finite.end());
  return *at;
}

// All but the outermost 0.1 % at either end, so that one outlier does not flatten the rest.
std::array<double, 2> shown_range(const std::vector<float>& values) {
  std::vector<float> finite;
  for (const float v : values)
    if (std::isfinite(v)) finite.push_back(v);
  if (finite.empty()) return {0, 0};
  return {quantile(finite, 0.001), quantile(finite, 0.999)};
}

Picture one_channel_picture(const std::string& name, std::vector<float> values, int width, int height) {
  for (float& v : values)
    if (v >= kNoHitDepth) v = std::numeric_limits<float>::quiet_NaN();
  const auto [low, high] = shown_range(values);
  return false_colour(values, width, height, {ColourMap::Sequential, low, high, name});
}

// Positions: each axis from its lowest to its highest shown value, x red, y green, z blue.
Picture position_picture(const std::vector<Rgb>& positions, int width, int height) {
  std::array<std::array<double, 2>, 3> range{};
  for (int k = 0; k < 3; ++k) {
    std::vector<float> axis;
    for (const Rgb& p : positions) axis.push_back(p[k]);
    range[static_cast<std::size_t>(k)] = shown_range(axis);
  }
  return colour_picture(positions, width, height, [&](const RgbD& p) {
    RgbD c;
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] = range[static_cast<std::size_t>(k)];
      c[k] = high > low ? srgb_decoded(std::clamp((p[k] - low) / (high - low), 0.0, 1.0)) : 0.5;
    }
    return c;
  });
}

}  // namespace

void write_preview(const std::filesystem::path& png, const Image& image, const PreviewOptions& options) {
  const std::string& name = options.layer;
  const auto write = [&](const Picture& p) { write_png(png, p.width, p.height, p.srgb); };
  if (const ImageChannel* channel = image.find(name); channel && !name.empty())
    return write(one_channel_picture(name, channel->values, image.width, image.height));

  const std::vector<Rgb> colour = image.layer(name, png.string());
  if (name == "N")
    return write(colour_picture(colour, image.width, image.height, [](const RgbD& n) {
      return RgbD(srgb_decoded(std::clamp(0.5 + 0.5 * n.r, 0.0, 1.0)),
                  srgb_decoded(std::clamp(0.5 + 0.5 * n.g, 0.0, 1.0)),
                  srgb_decoded(std::clamp(0.5 + 0.5 * n.b, 0.0, 1.0)));
    }));
  if (name == "P") return write(position_picture(colour, image.width, image.height));
  // Shares of light: as they are.
  if (name == "albedo" || name == "transmittance")
    return write(colour_picture(colour, image.width, image.height, [](const RgbD& c) { return c; }));

  double gain = std::exp2(options.exposure);
  if (options.automatic_exposure) {
    const double average = log_average(colour);
    if (average > 0) gain *= kMiddleGrey / average;
  }
  write(colour_picture(colour, image.width, image.height, [&](const RgbD& c) {
    return RgbD(tone_mapped(gain * c.r), tone_mapped(gain * c.g), tone_mapped(gain * c.b));
  }));
}

}  // namespace brume
