// Float images made of named channels, and the files they are kept in.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <variant>
#include <vector>

#include "core/math.h"

namespace brume {

// Row 0 is the top. `name` is as in the file: "R", "diffuse_indirect.G", "Z".
struct ImageChannel {
  std::string name;
  bool is_half = true;  // How it is stored; in memory it is float.
  std::vector<float> values;
};

struct Image {
  int width = 0, height = 0;
  std::vector<ImageChannel> channels;

  // Null where there is none of that name.
  const ImageChannel* find(const std::string& name) const;
  // The colour of layer `layer` ("" is R, G, B; else layer.R ...); throws Error(InvalidInput) if absent.
  std::vector<Rgb> layer(const std::string& layer, const std::string& file_name = "image") const;
  // Names of the colour layers and data layers, "" first.
  std::vector<std::string> layer_names() const;
};

struct Chromaticities;
using MetadataValue = std::variant<std::string, double, std::int64_t, std::array<float, 16>>;
using ImageMetadata = std::map<std::string, MetadataValue>;

struct ImageFile {
  Image image;
  ImageMetadata metadata;
};

// EXR, one multi-layer part, ZIP, Rec.709 chromaticities; written aside, synced, renamed. NaN and
// infinities are an Error(Internal): they must have been counted and replaced before. Values beyond
// half's range are clamped to it; how many is returned.
std::size_t write_exr(const std::filesystem::path& file, const Image& image,
                      const ImageMetadata& metadata);
// EXR, HDR, PNG (sRGB is linearised), PFM, TIFF. Throws Error(InvalidInput) for what cannot be read or
// exceeds `max_pixels`.
ImageFile read_image(const std::filesystem::path& file, std::size_t max_pixels = std::size_t(1) << 28);

// 8-bit PNG; `srgb` holds 3 bytes a pixel.
void write_png(const std::filesystem::path& file, int width, int height,
               const std::vector<std::uint8_t>& srgb);

}  // namespace brume
