// Pictures for people: tone-mapped beauty, and data layers in false colour with a legend.
#pragma once

#include <filesystem>
#include <string>

#include "core/image.h"

namespace brume {

// Layer "" and colour layers are exposed by 2^exposure (with `automatic_exposure` so that the log-average
// luminance becomes middle grey first), tone mapped and written as sRGB PNG. One-channel layers become
// false colour with a legend that states name and range (its outermost 0.1 % saturate). N is shown as
// (n + 1) / 2, P scaled to its range, albedo and transmittance as they are. Throws Error(InvalidInput)
// for a layer the image does not have.
struct PreviewOptions {
  std::string layer;
  bool automatic_exposure = false;
  double exposure = 0;  // Stops.
};
void write_preview(const std::filesystem::path& png, const Image& image, const PreviewOptions& options);

}  // namespace brume
