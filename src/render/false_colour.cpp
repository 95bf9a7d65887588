#include "render/false_colour.h"

#include <cstdio>

#include "core/error.h"
#include "core/image.h"

namespace brume {
namespace {

using Byte3 = std::array<std::uint8_t, 3>;
constexpr Byte3 kNoValue{96, 96, 96}, kBackground{24, 24, 24}, kInk{230, 230, 230};
constexpr int kGlyphWidth = 5, kGlyphHeight = 7, kAdvance = 6;

// Rows from the top, five dots each, the left one in bit 4.
struct Glyph {
  char character;
  std::uint8_t rows[kGlyphHeight];
};
constexpr Glyph kFont[] = {
    {'A', {0x0e, 0x11, 0x11, 0x1f, 0x11, 0x11, 0x11}}, {'B', {0x1e, 0x11, 0x11, 0x1e, 0x11, 0x11, 0x1e}},
    {'C', {0x0e, 0x11, 0x10, 0x10, 0x10, 0x11, 0x0e}}, {'D', {0x1e, 0x11, 0x11, 0x11, 0x11, 0x11, 0x1e}},
    {'E', {0x1f, 0x10, 0x10, 0x1e, 0x10, 0x10, 0x1f}}, {'F', {0x1f, 0x10, 0x10, 0x1e, 0x10, 0x10, 0x10}},
    {'G', {0x0e, 0x11, 0x10, 0x17, 0x11, 0x11, 0x0f}}, {'H', {0x11, 0x11, 0x11, 0x1f, 0x11, 0x11, 0x11}},
    {'I', {0x0e, 0x04, 0x04, 0x04, 0x04, 0x04, 0x0e}}, {'J', {0x07, 0x02, 0x02, 0x02, 0x02, 0x12, 0x0c}},
    {'K', {0x11, 0x12, 0x14, 0x18, 0x14, 0x12, 0x11}}, {'L', {0x10, 0x10, 0x10, 0x10, 0x10, 0x10, 0x1f}},
    {'M', {0x11, 0x1b, 0x15, 0x15, 0x11, 0x11, 0x11}}, {'N', {0x11, 0x11, 0x19, 0x15, 0x13, 0x11, 0x11}},
    {'O', {0x0e, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e}}, {'P', {0x1e, 0x11, 0x11, 0x1e, 0x10, 0x10, 0x10}},
    {'Q', {0x0e, 0x11, 0x11, 0x11, 0x15, 0x12, 0x0d}}, {'R', {0x1e, 0x11, 0x11, 0x1e, 0x14, 0x12, 0x11}},
    {'S', {0x0f, 0x10, 0x10, 0x0e, 0x01, 0x01, 0x1e}}, {'T', {0x1f, 0x04, 0x04, 0x04, 0x04, 0x04, 0x04}},
    {'U', {0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e}}, {'V', {0x11, 0x11, 0x11, 0x11, 0x11, 0x0a, 0x04}},
    {'W', {0x11, 0x11, 0x11, 0x15, 0x15, 0x15, 0x0a}}, {'X', {0x11, 0x11, 0x0a, 0x04, 0x0a, 0x11, 0x11}},
    {'Y', {0x11, 0x11, 0x11, 0x0a, 0x04, 0x04, 0x04}}, {'Z', {0x1f, 0x01, 0x02, 0x04, 0x08, 0x10, 0x1f}},
    {'0', {0x0e, 0x11, 0x13, 0x15, 0x19, 0x11, 0x0e}}, {'1', {0x04, 0x0c, 0x04, 0x04, 0x04, 0x04, 0x0e}},
    {'2', {0x0e, 0x11, 0x01, 0x02, 0x04, 0x08, 0x1f}}, {'3', {0x1f, 0x02, 0x04, 0x02, 0x01, 0x11, 0x0e}},
    {'4', {0x02, 0x06, 0x0a, 0x12, 0x1f, 0x02, 0x02}}, {'5', {0x1f, 0x10, 0x1e, 0x01, 0x01, 0x11, 0x0e}},
    {'6', {0x06, 0x08, 0x10, 0x1e, 0x11, 0x11, 0x0e}}, {'7', {0x1f, 0x01, 0x02, 0x04, 0x08, 0x08, 0x08}},
    {'8', {0x0e, 0x11, 0x11, 0x0e, 0x11, 0x11, 0x0e}}, {'9', {0x0e, 0x11, 0x11, 0x0f, 0x01, 0x02, 0x0c}},
    {' ', {0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00}}, {'.', {0x00, 0x00, 0x00, 0x00, 0x00, 0x0c, 0x0c}},
    {',', {0x00, 0x00, 0x00, 0x00, 0x0c, 0x04, 0x08}}, {':', {0x00, 0x0c, 0x0c, 0x00, 0x0c, 0x0c, 0x00}},
    {'-', {0x00, 0x00, 0x00, 0x1f, 0x00, 0x00, 0x00}}, {'+', {0x00, 0x04, 0x04, 0x1f, 0x04, 0x04, 0x00}},
    {'_', {0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x1f}}, {'%', {0x18, 0x19, 0x02, 0x04, 0x08, 0x13, 0x03}},
    {'/', {0x00, 0x01, 0x02, 0x04, 0x08, 0x10, 0x00}}, {'(', {0x02, 0x04, 0x08, 0x08, 0x08, 0x04, 0x02}},
    {')', {0x08, 0x04, 0x02, 0x02, 0x02, 0x04, 0x08}}, {'=', {0x00, 0x00, 0x1f, 0x00, 0x1f, 0x00, 0x00}},
    {'<', {0x02, 0x04, 0x08, 0x10, 0x08, 0x04, 0x02}}, {'>', {0x08, 0x04, 0x02, 0x01, 0x02, 0x04, 0x08}},
};
constexpr Glyph kBox{'\0', {0x1f, 0x11, 0x11, 0x11, 0x11, 0x11, 0x1f}};

const Glyph& glyph_of(char c) {
  if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  for (const Glyph& g : kFont)
    if (g.character == c) return g;
  return kBox;
}

std::uint8_t to_byte(double encoded) {
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(encoded, 0.0, 1.0)));
}

// The map "viridis" of Nathaniel Smith and Stefan van der Walt (CC0), as the sixth-degree fit by Matt
// Zucker (CC0); sRGB, within 2 % of the table.
Byte3 sequential(double t) {
  constexpr double c[7][3] = {{0.2777273272, 0.0054073445, 0.3340998053},
                              {0.1050930431, 1.4046135299, 1.3845901626},
                              {-0.3308618287, 0.2148475595, 0.0950951630},
                              {-4.6342304990, -5.7991009734, -19.3324409563},
                              {6.2282699363, 14.1799333668, 56.6905526007},
                              {4.7763849977, -13.7451453777, -65.3530326334},
                              {-5.4354558559, 4.6458526122, 26.3124352496}};
  Byte3 colour{};
  for (std::size_t k = 0; k < 3; ++k) {
    double v = c[6][k];
    for (int i = 5; i >= 0; --i) v = v * t + c[i][k];
    colour[k] = to_byte(v);
  }
  return colour;
}

// Straight lines in Oklab (B. Ottosson 2020, public domain) between five colours that mirror each
// other in lightness: steps look even and neither side outweighs the other.
Byte3 diverging(double t) {
  constexpr double anchors[5][3] = {{0.36, -0.02, -0.14},  // L, a, b: dark blue,
                                    {0.62, -0.05, -0.13},  // blue,
                                    {0.95, 0.00, 0.00},    // near-white,
                                    {0.62, 0.16, 0.09},    // red,
                                    {0.36, 0.13, 0.06}};   // dark red.
  const double s = std::clamp(t, 0.0, 1.0) * 4;
  const int i = std::min(3, static_cast<int>(s));
  const double f = s - i;
  double lab[3];
  for (int k = 0; k < 3; ++k) lab[k] = anchors[i][k] * (1 - f) + anchors[i + 1][k] * f;
  const double l = std::pow(lab[0] + 0.3963377774 * lab[1] + 0.2158037573 * lab[2], 3);
  const double m = std::pow(lab[0] - 0.1055613458 * lab[1] - 0.0638541728 * lab[2], 3);
  const double n = std::pow(lab[0] - 0.0894841775 * lab[1] - 1.2914855480 * lab[2], 3);
  const double rgb[3] = {4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * n,
                         -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * n,
                         -0.0041960863 * l - 0.7034186147 * m + 1.7076147010 * n};
  Byte3 colour{};
  for (std::size_t k = 0; k < 3; ++k) colour[k] = to_byte(srgb_encoded(std::max(0.0, rgb[k])));
  return colour;
}

std::string number_text(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", v);
  return text;
}

}  // namespace

Picture::Picture(int width_, int height_)
    : width(width_), height(height_), srgb(std::size_t(3) * width_ * height_) {}

void Picture::set(int x, int y, const Byte3& colour) {
  if (x < 0 || y < 0 || x >= width || y >= height) return;
  std::copy(colour.begin(), colour.end(), srgb.begin() + 3 * (std::ptrdiff_t(y) * width + x));
}

Byte3 map_colour(ColourMap map, double t) {
  if (std::isnan(t)) return kNoValue;
  t = std::clamp(t, 0.0, 1.0);
  return map == ColourMap::Sequential ? sequential(t) : diverging(t);
}

int text_width(const std::string& text, int scale) {
  return text.empty() ? 0 : (static_cast<int>(text.size()) * kAdvance - 1) * scale;
}

void draw_text(Picture& picture, int x, int y, const std::string& text, int scale, const Byte3& colour) {
  for (const char c : text) {
    const Glyph& glyph = glyph_of(c);
    for (int row = 0; row < kGlyphHeight * scale; ++row)
      for (int column = 0; column < kGlyphWidth * scale; ++column)
        if (glyph.rows[row / scale] >> (kGlyphWidth - 1 - column / scale) & 1)
          picture.set(x + column, y + row, colour);
    x += kAdvance * scale;
  }
}

Picture false_colour(const std::vector<float>& values, int width, int height,
                     const FalseColourOptions& options) {
  BRUME_ASSERT(values.size(), ==, std::size_t(width) * height);
  const int scale = 1 + width / 900, margin = 4 * scale, bar = 10 * scale;
  const int text_height = kGlyphHeight * scale;
  const std::string low = number_text(options.low), high = number_text(options.high);
  const std::string middle = number_text((options.low + options.high) / 2);
  const int numbers = text_width(low, scale) + text_width(middle, scale) + text_width(high, scale);
  const int needed =
      2 * margin + std::max(numbers + 4 * margin, text_width(options.title, scale));
  const int full = std::max(width, needed);
  Picture picture(full, height + 4 * margin + bar + 2 * text_height);
  for (int y = 0; y < picture.height; ++y)
    for (int x = 0; x < full; ++x) picture.set(x, y, kBackground);

  const double span = options.high - options.low;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double v = values[std::size_t(y) * width + x];
      // A range of no width: everything is its middle.
      picture.set(x, y, map_colour(options.map, span > 0 || std::isnan(v) ? (v - options.low) / span : 0.5));
    }

  // Title, bar, then the numbers under the bar's ends and middle.
  int y = height + margin;
  draw_text(picture, (full - text_width(options.title, scale)) / 2, y, options.title, scale, kInk);
  y += text_height + margin;
  const int bar_width = full - 2 * margin;
  for (int x = 0; x < bar_width; ++x)
    for (int row = 0; row < bar; ++row)
      picture.set(margin + x, y + row, map_colour(options.map, (x + 0.5) / bar_width));
  y += bar + margin;
  draw_text(picture, margin, y, low, scale, kInk);
  draw_text(picture, (full - text_width(middle, scale)) / 2, y, middle, scale, kInk);
  draw_text(picture, full - margin - text_width(high, scale), y, high, scale, kInk);
  return picture;
}

}  // namespace brume
