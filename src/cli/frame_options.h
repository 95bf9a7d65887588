// Which camera at which size, and which file the cache is: what render and bake choose alike.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>

#include "cli/command.h"
#include "cli/values.h"
#include "scene/scene.h"

namespace brume {

struct SizeOptions {
  std::optional<Size2> resolution;
  std::optional<double> scale;

  // Of a frame of `film`; at least one pixel each way.
  Size2 resolved(const Film& film) const;
};
void add_size_options(CLI::App& app, CommandContext& context, SizeOptions& options);

struct CacheOptions {
  std::filesystem::path file;
  std::optional<CacheMode> mode;

  // A flag or variable wins over the scene file. #### becomes the frame number.
  CacheSettings resolved(const CacheSettings& scene, const std::optional<int>& frame) const;
};
void add_cache_mode_option(CLI::App& app, CommandContext& context, CacheOptions& options);

}  // namespace brume
