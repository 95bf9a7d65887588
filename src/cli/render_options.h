// The options of `render` and what may not be combined.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "cli/frame_options.h"
#include "cli/outputs.h"
#include "cli/self_check.h"
#include "cli/shared_options.h"
#include "core/math.h"
#include "render/path_tracer.h"

namespace brume {

enum class Integrator { Cached, Path };

struct RenderOptions {
  SceneOptions scene;
  AccuracyOptions accuracy;
  SizeOptions size;
  CacheOptions cache;
  SelfCheckOptions check;
  std::filesystem::path output, preview;
  std::string camera, preview_layer;
  std::optional<CropRegion> crop;
  std::optional<Size2> pixel;
  std::optional<Integrator> integrator;
  std::optional<Transport> transport;
  std::optional<int> samples, eye_shells;
  std::optional<double> noise;
  std::optional<std::optional<double>> exposure;  // Outer: given; inner: stops, none: automatic.
  std::optional<bool> half_colour;
  std::vector<std::string> aovs;
  std::optional<ExistingPolicy> existing;
  std::optional<std::uint64_t> max_pixels;
  bool reproducible = false;
  bool gather_everywhere = false;

  bool is_path() const { return integrator == Integrator::Path; }
  bool has_cached_transport() const {
    return !is_path() || transport.value_or(Transport::Full) == Transport::Cached;
  }
  int sample_count() const;
  int eye_shell_count() const;
  FilmOptions film() const;
  // --reproducible, or SOURCE_DATE_EPOCH is set.
  bool is_reproducible() const;
  void check_size(const Size2& frame_size) const;
};

void add_render_options(CLI::App& app, CommandContext& context, RenderOptions& options);

// Throws Error(Usage) for options that contradict each other or would be ignored.
void check_combinations(const RenderOptions& options);

struct CropIntervals {
  Interval x{0, 1}, y{0, 1};  // Parts of the image.
  std::size_t pixels = 0;
};
// Throws Error(Usage) for a crop that is not inside the image.
CropIntervals crop_of(const RenderOptions& options, const Size2& size);

}  // namespace brume
