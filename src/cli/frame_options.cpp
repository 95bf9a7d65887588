#include "cli/frame_options.h"

#include <algorithm>

#include "cli/environment.h"
#include "cli/outputs.h"

namespace brume {
namespace {

constexpr int kMaxSide = 1 << 20;

int scaled(int pixels, double scale) {
  return static_cast<int>(std::clamp(std::round(pixels * scale), 1.0, double(kMaxSide)));
}

}  // namespace

Size2 SizeOptions::resolved(const Film& film) const {
  const Size2 size = resolution.value_or(Size2{film.width, film.height});
  return {scaled(size.x, scale.value_or(1)), scaled(size.y, scale.value_or(1))};
}

void add_size_options(CLI::App& app, CommandContext& context, SizeOptions& options) {
  with_environment(context, app,
                   add_parsed(
                       app, "--res", "WxH", options.resolution,
                       [](const std::string& option, const std::string& text) {
                         return std::optional<Size2>(parse_size(option, text, kMaxSide));
                       },
                       "Size in pixels, like 1920x1080 (default: the scene's)"))
      ->group("Frame");
  with_environment(context, app,
                   add_number(app, "--res-scale", options.scale, 1e-3, 100, "Multiplies the size"))
      ->group("Frame");
}

CacheSettings CacheOptions::resolved(const CacheSettings& scene,
                                     const std::optional<int>& frame) const {
  CacheSettings result = scene;
  if (!file.empty()) result.file = file;
  if (mode) result.mode = *mode;
  result.file = with_frame(result.file, frame);
  return result;
}

void add_cache_mode_option(CLI::App& app, CommandContext& context, CacheOptions& options) {
  with_environment(
      context, app,
      add_choice<CacheMode>(app, "--cache-mode",
                            {{"new", CacheMode::New},
                             {"append", CacheMode::Append},
                             {"missing", CacheMode::Missing},
                             {"read", CacheMode::Read}},
                            options.mode,
                            "new: replace; append: keep, and add what these views need; "
                            "missing (default): fill what is not there; read: never bake"))
      ->group("Cache");
}

}  // namespace brume
