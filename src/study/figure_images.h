// Maps and frames of the figures as PNG files, each with what its colours mean.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "study/figures.h"

namespace brume {

struct FigureImage {
  std::filesystem::path file;
  std::string title;    // Below the picture.
  std::string numbers;  // In smaller print; may be empty.
};

// A row of pictures that share one exposure.
struct FigureRow {
  std::string heading;
  std::string scale;          // What colours stand for, in words.
  bool is_diverging = false;  // Blue to red: the page shows a bar, `low` to `high` in percent.
  double low = 0, high = 0;
  std::vector<FigureImage> images;
};

// Write NAME_*.png into `folder`.
std::vector<FigureRow> write_ground_images(const FigureScene& scene,
                                           const std::filesystem::path& folder);
std::vector<FigureRow> write_result_images(const FigureScene& scene,
                                           const std::filesystem::path& folder);

// For people, and for file names and JSON.
const char* gradient_source_name(GradientSource source);
const char* gradient_source_key(GradientSource source);
// Three digits, without an exponent where the number is an everyday one.
std::string short_number(double value);

}  // namespace brume
