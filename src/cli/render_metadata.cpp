#include "cli/render_metadata.h"

#include "cli/version.h"
#include "core/error.h"

namespace brume {
namespace {

// "none" for none: EXR readers take an empty attribute for a missing one.
std::string joined(const std::vector<std::string>& parts, const std::string& separator) {
  if (parts.empty()) return "none";
  std::string text;
  for (const std::string& part : parts)
    text += (text.empty() ? "" : separator) + printable(part, 4096);
  return text;
}

// As a shell would have to be given them.
std::string command_line(const std::vector<std::string>& arguments) {
  std::string line = "brume";
  for (const std::string& argument : arguments) {
    const bool is_plain =
        !argument.empty() && argument.find_first_not_of(
                                 "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                 "0123456789_-+=/.,:@%#") == std::string::npos;
    if (is_plain) {
      line += ' ' + argument;
      continue;
    }
    line += " '";
    for (const char c : argument) line += c == '\'' ? std::string("'\\''") : std::string(1, c);
    line += '\'';
  }
  return printable(line, 16384);
}

}  // namespace

ImageMetadata render_metadata(const RenderProvenance& p) {
  const auto integer = [](std::uint64_t n) { return static_cast<std::int64_t>(n); };
  ImageMetadata data;
  data["software"] = program_version();
  data["worldToCamera"] = p.rays.world_to_camera();
  data["brume:fovDeg"] = p.rays.fov_deg();
  data["brume:sceneHash"] = p.scene_fingerprint.hex();
  if (p.cache_fingerprint) data["brume:cacheHash"] = p.cache_fingerprint->hex();
  data["brume:samples"] = integer(p.samples);
  data["brume:records"] = integer(p.statistics.records);
  data["brume:grids"] = joined(p.scene.grids, "; ");
  data["brume:effects"] = joined(p.statistics.effects, ", ");
  data["brume:badVoxels"] = integer(p.scene.bad_voxels.total());
  data["brume:nanPixels"] = integer(p.bad_pixels);
  if (p.check) {
    data["brume:verifiedPoints"] = integer(static_cast<std::uint64_t>(p.check->points));
    data["brume:bias"] = p.check->bias;
    data["brume:rmse"] = p.check->rmse;
  }
  if (p.is_reproducible) return data;
  data["command"] = command_line(p.arguments);
  for (const auto& [stage, seconds] : p.statistics.seconds)
    data["brume:seconds:" + stage] = seconds;
  data["brume:peakBytes"] = integer(peak_memory_bytes());
  return data;
}

}  // namespace brume
