#include "render/film.h"

#include <half.h>

#include <algorithm>
#include <functional>

#include "core/error.h"

namespace brume {
namespace {

// What a channel holds and where a pixel keeps it. A colour counts as one value: with one bad
// component all three become 0, so that no pixel changes its hue.
struct DataLayer {
  const char* name;
  std::vector<const char*> parts;
  std::function<double(const PixelResult&, int part)> value;
};

const std::vector<DataLayer>& data_layers() {
  static const std::vector<DataLayer> layers{
      {"Z", {""}, [](const PixelResult& p, int) {
         return p.z == kInfinity ? double(kNoHitDepth) : p.z;
       }},
      {"N", {".X", ".Y", ".Z"}, [](const PixelResult& p, int i) { return p.normal[i]; }},
      {"P", {".X", ".Y", ".Z"}, [](const PixelResult& p, int i) { return p.position[i]; }},
      {"albedo", {".R", ".G", ".B"}, [](const PixelResult& p, int i) { return p.albedo[i]; }},
      {"transmittance", {".R", ".G", ".B"},
       [](const PixelResult& p, int i) { return p.transmittance[i]; }},
      {"cache_count", {""}, [](const PixelResult& p, int) { return p.cache_count; }},
      {"cost", {""}, [](const PixelResult& p, int) { return p.cost; }},
  };
  return layers;
}

// A value as the file will hold it.
float stored(double value, bool half_colour) {
  const auto f = static_cast<float>(value);
  if (!half_colour) return f;
  constexpr float kHalfMax = 65504;
  return std::isfinite(f) ? float(Imath::half(std::clamp(f, -kHalfMax, kHalfMax))) : f;
}

void check_names(const std::vector<std::string>& aovs) {
  std::vector<std::string> known{"beauty"};
  for (int l = 0; l < kLayerCount; ++l) known.push_back(layer_name(static_cast<Layer>(l)));
  for (const DataLayer& d : data_layers()) known.push_back(d.name);
  for (const std::string& name : aovs) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    std::string list;
    for (const std::string& k : known) list += (list.empty() ? "" : ", ") + k;
    throw Error(ErrorKind::Usage, "layer '" + printable(name, 60) + "' is unknown: choose from " + list);
  }
}

}  // namespace

const char* layer_name(Layer layer) {
  switch (layer) {
    case Layer::DiffuseDirect: return "diffuse_direct";
    case Layer::DiffuseIndirect: return "diffuse_indirect";
    case Layer::GlossyDirect: return "glossy_direct";
    case Layer::GlossyIndirect: return "glossy_indirect";
    case Layer::VolumeDirect: return "volume_direct";
    case Layer::VolumeIndirect: return "volume_indirect";
    case Layer::VolumeEmission: return "volume_emission";
    case Layer::Emission: return "emission";
    case Layer::Background: return "background";
  }
  throw Error(ErrorKind::Internal, "layer " + std::to_string(static_cast<int>(layer)) + " has no name");
}

RgbD PixelResult::beauty() const {
  RgbD sum;
  for (const RgbD& l : layers) sum += l;
  return sum;
}

PixelFilm::PixelFilm(int width, int height)
    : width_(width), height_(height), pixels_(std::size_t(width) * std::size_t(height)) {
  BRUME_ASSERT(width, >, 0);
  BRUME_ASSERT(height, >, 0);
}

PixelFilm::Developed PixelFilm::develop(const FilmOptions& options) const {
  check_names(options.aovs);
  const auto wanted = [&](const std::string& name) {
    return options.aovs.empty() ||
           std::find(options.aovs.begin(), options.aovs.end(), name) != options.aovs.end();
  };
  Developed result;
  Image& image = result.image;
  image.width = width_;
  image.height = height_;
  const std::size_t count = pixels_.size();
  const auto add_channel = [&](const std::string& name, bool is_half) {
    image.channels.push_back({name, is_half, std::vector<float>(count)});
    return image.channels.size() - 1;
  };
  std::vector<bool> bad(count, false);

  // Beauty adds up the layers as the file holds them, whichever of them are kept: then the layers of
  // a file sum to its beauty up to one rounding, and beauty does not depend on the choice of layers.
  std::vector<RgbD> beauty(count);
  for (const char* name : {"R", "G", "B", "A"}) add_channel(name, options.half_colour);
  for (int l = 0; l < kLayerCount; ++l) {
    const std::string name = layer_name(static_cast<Layer>(l));
    const bool keep = wanted(name);
    const std::size_t first = image.channels.size();
    if (keep)
      for (const char* part : {".R", ".G", ".B"}) add_channel(name + part, options.half_colour);
    for (std::size_t i = 0; i < count; ++i) {
      const RgbD& exact = pixels_[i].layers[static_cast<std::size_t>(l)];
      Rgb c(stored(exact.r, options.half_colour), stored(exact.g, options.half_colour),
            stored(exact.b, options.half_colour));
      if (!is_finite(c)) {
        bad[i] = true;
        c = Rgb();
      }
      beauty[i] += RgbD(c);
      if (keep)
        for (int k = 0; k < 3; ++k) image.channels[first + static_cast<std::size_t>(k)].values[i] = c[k];
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k)
      image.channels[static_cast<std::size_t>(k)].values[i] = stored(beauty[i][k], options.half_colour);
    float alpha = stored(pixels_[i].alpha, options.half_colour);
    if (!std::isfinite(alpha)) {
      bad[i] = true;
      alpha = 0;
    }
    image.channels[3].values[i] = alpha;
  }

  for (const DataLayer& layer : data_layers()) {
    if (!wanted(layer.name)) continue;
    const std::size_t first = image.channels.size();
    for (const char* part : layer.parts) add_channel(std::string(layer.name) + part, false);
    for (std::size_t i = 0; i < count; ++i) {
      bool finite = true;
      for (std::size_t k = 0; k < layer.parts.size(); ++k) {
        const auto v = static_cast<float>(layer.value(pixels_[i], static_cast<int>(k)));
        finite = finite && std::isfinite(v);
        image.channels[first + k].values[i] = v;
      }
      if (finite) continue;
      bad[i] = true;
      for (std::size_t k = 0; k < layer.parts.size(); ++k) image.channels[first + k].values[i] = 0;
    }
  }
  result.bad_pixels = static_cast<std::size_t>(std::count(bad.begin(), bad.end(), true));
  return result;
}

}  // namespace brume
