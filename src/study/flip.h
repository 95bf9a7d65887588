// FLIP: how different two images look when one is flipped into the other [ANAM*20].
#pragma once

#include <vector>

#include "core/math.h"

namespace brume {

// A pixel spans 1/67 degree: a 0.7 m wide display of 3840 pixels seen from 0.7 m, the paper's default.
inline constexpr double kFlipPixelsPerDegree = 67;

// The LDR error of each pixel, in [0, 1]; 0 for equal images, and the same with a and b exchanged.
// Both hold linear Rec.709 of width * height pixels, ready for display: values are clamped to [0, 1].
std::vector<float> flip_map(const std::vector<Rgb>& a, const std::vector<Rgb>& b, int width, int height,
                            double pixels_per_degree = kFlipPixelsPerDegree);

}  // namespace brume
