// Numbers as colours, with a legend: for data layers and for differences between images.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/math.h"

namespace brume {

// 8-bit sRGB, 3 bytes a pixel, row 0 at the top.
struct Picture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> srgb;

  Picture(int width_, int height_);
  // Outside the picture it does nothing.
  void set(int x, int y, const std::array<std::uint8_t, 3>& colour);
};

// Sequential runs from dark to light, Diverging from blue over near-white (0.5) to red. Both change
// evenly to the eye and stay apart for colour-blind readers.
enum class ColourMap { Sequential, Diverging };
// `t` is clamped to [0, 1]; NaN, which stands for "no value here", is grey.
std::array<std::uint8_t, 3> map_colour(ColourMap map, double t);

struct FalseColourOptions {
  ColourMap map = ColourMap::Sequential;
  double low = 0, high = 1;  // Values at the ends of the map; beyond them it saturates.
  std::string title;         // Printable ASCII, shown in capitals.
};
// The values, one a pixel, and a legend below that states title and range; wider than the image where
// the image is too narrow for its legend.
Picture false_colour(const std::vector<float>& values, int width, int height,
                     const FalseColourOptions& options);

// Below the tiny fonts of other programs: capitals, digits and signs of 5x7 dots, `scale` pixels a
// dot; other characters show as a box.
int text_width(const std::string& text, int scale);
void draw_text(Picture& picture, int x, int y, const std::string& text, int scale,
               const std::array<std::uint8_t, 3>& colour);

}  // namespace brume
