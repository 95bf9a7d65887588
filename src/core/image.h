// Float images made of named channels, and the files they are kept in.
#pragma once

#include <array>
#include <cstdint>
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
  // The colour of layer `layer`: "" (or "beauty") is R, G, B; else layer.R/.G/.B, or layer.X/.Y/.Z as
  // they are. A layer of one channel ("Z", "cost"; "Y" for "") is grey. Throws Error(InvalidInput)
  // listing the layers there are.
  std::vector<Rgb> layer(const std::string& layer, const std::string& file_name = "image") const;
  // Names of the layers that layer() answers to, "" first where there is one, the others sorted.
  std::vector<std::string> layer_names() const;
};

// A matrix is row-major and acts on column vectors, like Affine3d. OpenEXR's act on row vectors, so
// its files hold the transpose.
using MetadataValue = std::variant<std::string, double, std::int64_t, std::array<float, 16>>;
using ImageMetadata = std::map<std::string, MetadataValue>;

struct ImageFile {
  Image image;
  ImageMetadata metadata;
};

// EXR, one multi-layer part, ZIP, Rec.709 chromaticities; written aside, synced, renamed. NaN and
// infinities are an Error(Internal): they must have been counted and replaced before. Values beyond
// half's range are clamped to it; how many is returned. The file holds `metadata` and nothing of the
// clock or the host: equal arguments give equal bytes. Integers beyond 32 bits, for which EXR has no
// type, are stored as text.
std::size_t write_exr(const std::filesystem::path& file, const Image& image,
                      const ImageMetadata& metadata);
// EXR, HDR, PNG, PFM, TIFF, known by their first bytes. Integer samples are taken for sRGB and
// linearised; grey becomes R = G = B; an EXR data window is placed in its display window. Colours are
// as stored (associated alpha). Throws Error(InvalidInput) for what cannot be read or exceeds
// `max_pixels`, before memory is spent on it.
ImageFile read_image(const std::filesystem::path& file, std::size_t max_pixels = std::size_t(1) << 28);

// 8-bit PNG; `srgb` holds 3 bytes a pixel.
void write_png(const std::filesystem::path& file, int width, int height,
               const std::vector<std::uint8_t>& srgb);

// The sRGB transfer functions, of values in [0, 1] (IEC 61966-2-1).
double srgb_encoded(double linear);
double srgb_decoded(double encoded);

}  // namespace brume
