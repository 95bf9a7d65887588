// Pictures for people: tone-mapped beauty, and data layers in false colour with a legend.
#pragma once

#include <filesystem>
#include <string>

#include "core/image.h"

namespace brume {

// Layer "" and colour layers are exposed (so that the mean of log luminance is middle grey when
// `exposure` is 0, else by 2^exposure), tone mapped and written as sRGB PNG. One-channel layers become
// false colour with a legend that states range and name.
struct PreviewOptions {
  std::string layer;
  bool automatic_exposure = false;
  double exposure = 0;  // Stops.
};
void write_preview(const std::filesystem::path& png, const Image& image, const PreviewOptions& options);

}  // namespace brume
