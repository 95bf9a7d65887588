// Options that several verbs share: how a scene is loaded, and what its accuracy costs.
#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "bake/bake.h"
#include "cli/command.h"
#include "scene/scene_file.h"

namespace brume {

struct SceneOptions {
  std::filesystem::path file;
  SceneFileOptions load;
  std::optional<BadVoxelPolicy> on_bad_voxels;
  std::optional<BackgroundPolicy> background;
  std::optional<std::uint64_t> memory_limit, max_voxels, max_triangles;
  std::optional<double> load_timeout;

  SceneFileOptions file_options() const;
};

// The positional SCENE, -D and everything about loading.
enum class SceneArgument { Required, Optional };
void add_scene_options(CLI::App& app, CommandContext& context, SceneOptions& options,
                       SceneArgument argument = SceneArgument::Required);
// Only limits and policies of .vdb files (inspect).
void add_grid_options(CLI::App& app, CommandContext& context, SceneOptions& options);

// Loads a scene file, or makes a scene around a bare .vdb; says on `err` what was chosen, dropped
// and replaced.
Scene load_scene_verbosely(const SceneOptions& options, const CommandContext& context);

enum class Preset { Draft, Normal, High, Reference };

// What a preset sets. Normal is every option's default.
struct PresetValues {
  int cells_theta, cells_phi;
  double footprint;
  int lamp_samples;
  double error;
  LightDepth light_depth;
  int samples, eye_shells;
};
PresetValues preset_values(Preset preset);

struct AccuracyOptions {
  std::optional<Preset> preset;
  std::optional<std::pair<int, int>> cells;
  std::optional<int> shells, lamp_samples, bounces;
  std::optional<double> footprint, step_voxels, error, min_radius, max_radius;
  std::optional<GradientMode> gradient;
  std::optional<std::optional<int>> volume_bounces;  // Outer: given; inner: not auto.
  std::optional<std::uint64_t> seed;
  std::optional<LightDepth> light_depth;

  // A flag or variable wins over the preset, the preset over the scene file, that over the
  // defaults.
  BakeSettings bake_settings(const RenderSettings& scene) const;
  // bake_settings() of a cache that is there: `base` is what it was baked with.
  BakeSettings bake_settings(const BakeSettings& base) const;
};
void add_accuracy_options(CLI::App& app, CommandContext& context, AccuracyOptions& options);

LightingOptions lighting_options(const BakeSettings& settings, const CommandContext& context);


}  // namespace brume
