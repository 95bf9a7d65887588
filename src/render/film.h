// The layers of a frame while it is being rendered, and as an image (SPEC, "Images").
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/image.h"
#include "core/math.h"

namespace brume {

// Colour layers, whose sum is beauty.
enum class Layer {
  DiffuseDirect, DiffuseIndirect, GlossyDirect, GlossyIndirect, VolumeDirect, VolumeIndirect,
  VolumeEmission, Emission, Background
};
inline constexpr int kLayerCount = 9;
const char* layer_name(Layer layer);

// One pixel's answer: means over its samples.
struct PixelResult {
  std::array<RgbD, kLayerCount> layers{};
  double alpha = 0;      // Share of samples that hit a surface, plus 1 - transmittance elsewhere.
  double z = 0;          // Distance along the view axis of the nearest hit; infinity without one.
  Vec3d normal{0.0}, position{0.0};
  RgbD albedo, transmittance{1.0};
  double cache_count = 0;  // Records that answered, mean over samples.
  double cost = 0;         // March segments plus rays, mean over samples.

  RgbD& operator[](Layer l) { return layers[static_cast<std::size_t>(l)]; }
  const RgbD& operator[](Layer l) const { return layers[static_cast<std::size_t>(l)]; }
  RgbD beauty() const;
};

// Z in an image where nothing was hit: beyond any scene, and finite, since files hold no infinities.
inline constexpr float kNoHitDepth = 1e10f;

struct FilmOptions {
  bool half_colour = true;         // --depth half|float.
  std::vector<std::string> aovs;   // Names to keep besides beauty; empty: all.
};

// Pixels are written by their owner only; different pixels may be written from different threads.
class PixelFilm {
 public:
  PixelFilm(int width, int height);
  int width() const { return width_; }
  int height() const { return height_; }
  PixelResult& at(int x, int y) { return pixels_[std::size_t(y) * width_ + x]; }
  const PixelResult& at(int x, int y) const { return pixels_[std::size_t(y) * width_ + x]; }

  struct Developed {
    Image image;
    std::size_t bad_pixels = 0;  // Had a non-finite value, which became 0 in its layer.
  };
  // R G B A first, then layer.R/.G/.B, then data layers Z, N.XYZ, P.XYZ, albedo.RGB,
  // transmittance.RGB, cache_count, cost (float). Beauty is the sum of the layers as stored.
  // Throws Error(Usage) for an unknown name in `aovs`.
  Developed develop(const FilmOptions& options) const;

 private:
  int width_, height_;
  std::vector<PixelResult> pixels_;
};

}  // namespace brume
