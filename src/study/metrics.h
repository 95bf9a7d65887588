// How far one image is from another (SPEC, "JSON that scripts may rely on").
#pragma once

#include <vector>

#include "core/math.h"

namespace brume {

// On linear luminance unless said otherwise; b is the reference.
struct ImageDifference {
  double mae = 0, rmse = 0, max = 0, p99 = 0;  // Of |a - b|.
  double relmse = 0;       // mean((a-b)^2 / (b^2 + (0.01 mean(b))^2))
  double signed_mean = 0;  // mean(a) / mean(b) - 1
  double flip = 0;         // Mean LDR FLIP [ANAM*20] at an exposure that maps mean(b) to 0.18.
};
struct DifferenceMap {
  ImageDifference numbers;
  std::vector<float> flip;      // A pixel each.
  std::vector<float> relative;  // (a-b) / sqrt(b^2 + (0.01 mean(b))^2): signed.
};

// Both of width * height pixels. Throws Error(InvalidInput) on a size mismatch or a value that is not
// finite. Against a black reference the relative measures are 0 where a is black too, else infinite.
DifferenceMap compare_images(const std::vector<Rgb>& a, const std::vector<Rgb>& b, int width,
                             int height);

// RMSE of the mean luminances of `block` x `block` pixels over mean(b): averages out what is noise and
// leaves what is bias. Pixels beyond the last whole block are left out.
double block_nrmse(const std::vector<Rgb>& a, const std::vector<Rgb>& b, int width, int height,
                   int block);

}  // namespace brume
