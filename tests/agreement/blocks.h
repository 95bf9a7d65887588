// Frames as means over square blocks of pixels, which is what the two integrators are compared in.
#pragma once

#include <vector>

#include "render/film.h"

namespace brume::test {

inline constexpr int kBlockPixels = 16;

// Row-major; `layer` null: beauty.
inline std::vector<RgbD> block_means(const PixelFilm& film, const Layer* layer) {
  std::vector<RgbD> means;
  for (int by = 0; by + kBlockPixels <= film.height(); by += kBlockPixels)
    for (int bx = 0; bx + kBlockPixels <= film.width(); bx += kBlockPixels) {
      RgbD sum;
      for (int y = by; y < by + kBlockPixels; ++y)
        for (int x = bx; x < bx + kBlockPixels; ++x)
          sum += layer ? film.at(x, y)[*layer] : film.at(x, y).beauty();
      means.push_back(sum / double(kBlockPixels * kBlockPixels));
    }
  return means;
}

}  // namespace brume::test
