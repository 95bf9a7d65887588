#include "core/image.h"

#include <set>

#include "core/error.h"

namespace brume {
namespace {

// "diffuse.R" belongs to "diffuse" and "R" to ""; "Z" and "Depth.Z" are layers by themselves.
std::string layer_of_channel(const Image& image, const std::string& name) {
  const std::size_t dot = name.rfind('.');
  const std::string layer = dot == std::string::npos ? "" : name.substr(0, dot);
  const std::string part = dot == std::string::npos ? name : name.substr(dot + 1);
  const std::string prefix = layer.empty() ? "" : layer + ".";
  if (part == "R" || part == "G" || part == "B" || part == "A")
    return image.find(prefix + "R") ? layer : name;
  if (!layer.empty() && (part == "X" || part == "Y" || part == "Z"))
    return image.find(prefix + "X") ? layer : name;
  return name;
}

}  // namespace

const ImageChannel* Image::find(const std::string& name) const {
  for (const ImageChannel& c : channels)
    if (c.name == name) return &c;
  return nullptr;
}

std::vector<Rgb> Image::layer(const std::string& layer, const std::string& file_name) const {
  const std::string wanted = layer == "beauty" && !find("beauty.R") ? "" : layer;
  const std::string prefix = wanted.empty() ? "" : wanted + ".";
  const ImageChannel* parts[3] = {find(prefix + "R"), find(prefix + "G"), find(prefix + "B")};
  if (!parts[0] && !wanted.empty()) {
    parts[0] = find(prefix + "X"), parts[1] = find(prefix + "Y"), parts[2] = find(prefix + "Z");
  }
  if (!parts[0]) parts[0] = parts[1] = parts[2] = find(wanted.empty() ? "Y" : wanted);
  if (!parts[0] || !parts[1] || !parts[2]) {
    std::string known;
    for (const std::string& name : layer_names())
      known += (known.empty() ? "" : ", ") + (name.empty() ? "beauty" : printable(name, 60));
    throw Error(ErrorKind::InvalidInput,
                printable(file_name) + ": layer '" + printable(layer, 60) +
                    "' is not in this image: it has " + (known.empty() ? "no layers" : known));
  }
  std::vector<Rgb> colour(std::size_t(width) * height);
  for (std::size_t i = 0; i < colour.size(); ++i)
    colour[i] = {parts[0]->values[i], parts[1]->values[i], parts[2]->values[i]};
  return colour;
}

std::vector<std::string> Image::layer_names() const {
  std::set<std::string> names;
  for (const ImageChannel& c : channels) names.insert(layer_of_channel(*this, c.name));
  return {names.begin(), names.end()};
}

double srgb_encoded(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

double srgb_decoded(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

}  // namespace brume
