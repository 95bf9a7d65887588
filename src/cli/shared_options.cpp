#include "cli/shared_options.h"

#include <fstream>

#include "bake/scene_settings.h"
#include "cli/environment.h"
#include "cli/file_magic.h"
#include "cli/values.h"
#include "core/error.h"

namespace brume {
namespace {

const char* const kLoading = "Loading";
const char* const kAccuracy = "Accuracy";

template <typename T>
void set_if(T& target, const std::optional<T>& value) {
  if (value) target = *value;
}

}  // namespace

SceneFileOptions SceneOptions::file_options() const {
  SceneFileOptions result = load;
  set_if(result.grids.on_bad_voxels, on_bad_voxels);
  set_if(result.grids.background, background);
  set_if(result.grids.memory_limit_bytes, memory_limit);
  set_if(result.grids.max_voxels, max_voxels);
  set_if(result.grids.timeout_s, load_timeout);
  set_if(result.max_triangles, max_triangles);
  return result;
}

void add_grid_options(CLI::App& app, CommandContext& context, SceneOptions& options) {
  const auto setting = [&](CLI::Option* option) {
    with_environment(context, app, option)->group(kLoading);
  };
  setting(
      add_choice<BadVoxelPolicy>(app, "--on-bad-voxels",
                                 {{"zero", BadVoxelPolicy::Zero},
                                  {"clamp", BadVoxelPolicy::Clamp},
                                  {"error", BadVoxelPolicy::Error}},
                                 options.on_bad_voxels,
                                 "NaN, infinite and negative voxels: replace by zero (default), "
                                 "clamp to the nearest valid value, or refuse the file"));
  setting(add_choice<BackgroundPolicy>(
      app, "--background",
      {{"error", BackgroundPolicy::Error},
       {"zero", BackgroundPolicy::Zero},
       {"keep", BackgroundPolicy::Keep}},
      options.background,
      "A grid whose background is not 0: refuse (default), take as 0, or keep"));
  const auto bytes = [](const std::string& option, const std::string& text) {
    return std::optional<std::uint64_t>(parse_bytes(option, text));
  };
  setting(add_parsed(app, "--memory-limit", "SIZE", options.memory_limit, bytes,
                     "Memory for reading one .vdb file, like 4G (default: half of what there is)"));
  setting(add_number(app, "--load-timeout", options.load_timeout, 0.1, 86400,
                     "Seconds for reading one .vdb file (default 60)"));
  const auto count = [](const std::string& option, const std::string& text) {
    return std::optional<std::uint64_t>(parse_unsigned(option, text));
  };
  setting(add_parsed(app, "--max-voxels", "N", options.max_voxels, count,
                     "Refuse grids with more voxels (default 2^33)"));
}

void add_scene_options(CLI::App& app, CommandContext& context, SceneOptions& options,
                       SceneArgument argument) {
  app.add_option_function<std::string>(
         "SCENE", [&options](const std::string& text) { options.file = text; },
         "Scene file (JSON), or a .vdb file: then camera, light and ground are chosen, and said")
      ->required(argument == SceneArgument::Required);
  app.add_option("-D,--define", options.load.overrides,
                 "Overrides one value of the scene file, repeatable: -D /render/bounces=2")
      ->type_name("/POINTER=VALUE")
      ->allow_extra_args(false)
      ->group(kLoading);
  add_parsed(
      app, "--frame", "N", options.load.frame,
      [](const std::string& option, const std::string& text) {
        return std::optional<int>(
            static_cast<int>(parse_integer(option, text, -1'000'000, 100'000'000)));
      },
      "Frame number for #### in file names")
      ->group(kLoading);
  add_parsed(
      app, "--confine", "DIR", options.load.confine,
      [](const std::string& option, const std::string& text) {
        if (text.empty()) refuse_value(option, text, "a folder");
        return std::optional<std::filesystem::path>(text);
      },
      "Refuse files that leave this folder")
      ->group(kLoading);
  add_grid_options(app, context, options);
  with_environment(context, app,
                   add_parsed(
                       app, "--max-triangles", "N", options.max_triangles,
                       [](const std::string& option, const std::string& text) {
                         return std::optional<std::uint64_t>(parse_unsigned(option, text));
                       },
                       "Refuse scenes with more triangles (default 200,000,000)"))
      ->group(kLoading);
}

Scene load_scene_verbosely(const SceneOptions& options, const CommandContext& context) {
  const SceneFileOptions load = options.file_options();
  Scene scene;
  if (names_a_grid_file(options.file)) {
    if (!load.overrides.empty())
      throw Error(ErrorKind::Usage,
                  "-D: " + printable(options.file.string()) +
                      ": a .vdb file has no scene values to override: write a scene file");
    VdbScene made = make_vdb_scene(options.file, load);
    for (const std::string& note : made.notes) context.note(note);
    scene = std::move(made.scene);
  } else {
    scene = load_scene(options.file, load);
  }
  for (const std::string& warning : scene.warnings) context.warn(warning);
  for (const std::string& grid : scene.grids) context.info(grid);
  return scene;
}

PresetValues preset_values(Preset preset) {
  switch (preset) {
    case Preset::Draft:
      return {8, 25, 1, 2, 0.4, LightDepth::Volumes, 4, 12};
    case Preset::Normal:
      break;
    case Preset::High:
      return {24, 75, 0.5, 8, 0.1, LightDepth::Volumes, 64, 24};
    case Preset::Reference:
      return {48, 151, 0, 0, 0.06, LightDepth::Exact, 256, 32};
  }
  return {20, 64, 1, 4, 0.15, LightDepth::Volumes, 16, 16};
}

BakeSettings AccuracyOptions::bake_settings(const RenderSettings& scene) const {
  return bake_settings(settings_of(scene));
}

BakeSettings AccuracyOptions::bake_settings(const BakeSettings& base) const {
  BakeSettings s = base;
  if (preset) {
    const PresetValues values = preset_values(*preset);
    s.gather.cells_theta = values.cells_theta;
    s.gather.cells_phi = values.cells_phi;
    s.gather.footprint = values.footprint;
    s.gather.lamp_samples = values.lamp_samples;
    s.error = values.error;
    s.light_depth = values.light_depth;
  }
  if (cells) std::tie(s.gather.cells_theta, s.gather.cells_phi) = *cells;
  set_if(s.gather.shells, shells);
  set_if(s.gather.footprint, footprint);
  set_if(s.gather.lamp_samples, lamp_samples);
  set_if(s.gather.step_voxels, step_voxels);
  set_if(s.gather.gradient, gradient);
  set_if(s.bounces, bounces);
  if (volume_bounces) s.volume_bounces = volume_bounces->value_or(kEveryOrder);
  set_if(s.seed, seed);
  set_if(s.error, error);
  set_if(s.min_radius, min_radius);
  set_if(s.max_radius, max_radius);
  set_if(s.light_depth, light_depth);
  if (s.min_radius > s.max_radius)
    throw Error(
        ErrorKind::Usage,
        "--min-radius, --max-radius: the smallest radius exceeds the largest: exchange them");
  return s;
}

void add_accuracy_options(CLI::App& app, CommandContext& context, AccuracyOptions& options) {
  const auto setting = [&](CLI::Option* option) {
    with_environment(context, app, option)->group(kAccuracy);
  };
  setting(add_choice<Preset>(app, "--preset",
                             {{"draft", Preset::Draft},
                              {"normal", Preset::Normal},
                              {"high", Preset::High},
                              {"reference", Preset::Reference}},
                             options.preset,
                             "Sets cells, error, light depth, samples and eye shells together; "
                             "options given by themselves win"));
  setting(add_parsed(
      app, "--cells", "MxN", options.cells,
      [](const std::string& option, const std::string& text) {
        const Size2 size = parse_size(option, text, 4096);
        return std::optional<std::pair<int, int>>({size.x, size.y});
      },
      "Hemisphere cells of a gather, polar by azimuthal (default 20x64)"));
  setting(add_integer(app, "--shells", options.shells, 0, 4096,
                      "Distance shells of a gather's gradients; 0: as many as the medium needs"));
  setting(add_number(app, "--step-voxels", options.step_voxels, 0, 64,
                     "Least march step in voxels, smaller is finer; 0: none"));
  setting(add_number(app, "--footprint", options.footprint, 0, 16,
                     "Gathers march in steps as long as this share of the width that a ray stands "
                     "for; 0: cell by cell (default 1)"));
  setting(
      add_integer(app, "--lamp-samples", options.lamp_samples, 0, 65536,
                  "Samples of lights that a gather's ray asks for in the medium; 0: one of each "
                  "light from each shell (default 4)"));
  setting(add_choice<GradientMode>(app, "--gradient",
                                   {{"none", GradientMode::None},
                                    {"ward-heckbert", GradientMode::WardHeckbert},
                                    {"media", GradientMode::Media},
                                    {"full", GradientMode::Full}},
                                   options.gradient,
                                   "Gradients of irradiance: none, without the medium, without "
                                   "occlusion changes, or all terms (default full)"));
  setting(
      add_integer(app, "--bounces", options.bounces, 0, kMaxBounces,
                  "Reflections by surfaces before the one seen; 0: direct light only (default 4)"));
  setting(add_parsed(
      app, "--volume-bounces", "N|auto", options.volume_bounces,
      [](const std::string& option, const std::string& text) {
        std::optional<int> count;
        if (text != "auto") count = static_cast<int>(parse_integer(option, text, 0, 1'000'000));
        return std::optional<std::optional<int>>(count);
      },
      "Scatterings in the medium between two surfaces: 0 none, 1 light straight from lights, n, or "
      "as many as matter (default auto)"));
  setting(add_parsed(
      app, "--seed", "N", options.seed,
      [](const std::string& option, const std::string& text) {
        return std::optional<std::uint64_t>(parse_unsigned(option, text));
      },
      "Of all random numbers (default 1)"));
  setting(add_number(app, "--error", options.error, 0.001, 10,
                     "Split-sphere accuracy: a record's radius over the mean distance of what it "
                     "sees (default 0.15)"));
  const auto length = [](const std::string& option, const std::string& text) {
    return std::optional<double>(parse_length(option, text));
  };
  setting(add_parsed(app, "--min-radius", "LENGTH", options.min_radius, length,
                     "With --everywhere: records are placed no closer together, like 5mm (default "
                     "1cm)"));
  setting(add_parsed(app, "--max-radius", "LENGTH", options.max_radius, length,
                     "No record reaches farther, like 2m (default: as far as what it sees lets "
                     "it)"));
  setting(add_choice<LightDepth>(app, "--light-depth",
                                 {{"volumes", LightDepth::Volumes}, {"exact", LightDepth::Exact}},
                                 options.light_depth,
                                 "Optical depth towards lights: tabulated with a bounded error "
                                 "(default), or marched each time"));
}

LightingOptions lighting_options(const BakeSettings& settings, const CommandContext& context) {
  LightingOptions options;
  options.depth = settings.light_depth;
  options.march.step_voxels = settings.gather.step_voxels;
  options.threads = context.threads;
  return options;
}

}  // namespace brume
