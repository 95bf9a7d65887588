#include "cli/render_options.h"

#include <cstdlib>

#include "cli/environment.h"
#include "core/error.h"

namespace brume {
namespace {

constexpr std::uint64_t kMaxPixels = 1ull << 28;
constexpr int kPathSamples = 64;  // PathTracerOptions::samples.

void add_frame_options(CLI::App& app, CommandContext& context, RenderOptions& options) {
  const auto frame = [](CLI::Option* option) { option->group("Frame"); };
  frame(add_parsed(
      app, "--camera", "NAME", options.camera,
      [](const std::string&, const std::string& text) { return text; },
      "A camera of the scene by name (default: its own, else the first)"));
  add_size_options(app, context, options.size);
  frame(add_parsed(
      app, "--crop", "X0,Y0,X1,Y1", options.crop,
      [](const std::string& option, const std::string& text) {
        return std::optional<CropRegion>(parse_crop(option, text));
      },
      "Renders this part, the rest stays black: pixels where all are whole numbers, fractions of "
      "the "
      "frame where one has a decimal point"));
  frame(add_parsed(
      app, "--pixel", "X,Y", options.pixel,
      [](const std::string& option, const std::string& text) {
        return std::optional<Size2>(parse_pixel(option, text));
      },
      "Explains one pixel instead of writing an image: layers, what is seen, which records "
      "answer"));
}

void add_integrator_options(CLI::App& app, CommandContext& context, RenderOptions& options) {
  const auto setting = [&](CLI::Option* option) {
    with_environment(context, app, option)->group("Integrator");
  };
  setting(add_choice<Integrator>(app, "--integrator",
                                 {{"cached", Integrator::Cached}, {"path", Integrator::Path}},
                                 options.integrator,
                                 "cached: irradiance from records (default); path: unbiased path "
                                 "tracing"));
  setting(add_choice<Transport>(
      app, "--transport", {{"full", Transport::Full}, {"cached", Transport::Cached}},
      options.transport, "With path: every path (default), or those the cached integrator has"));
  setting(add_integer(app, "--spp", options.samples, 1, 1 << 20,
                      "Samples a pixel (default: cached 16, path 64)"));
  setting(add_number(app, "--noise", options.noise, 1e-6, 10,
                     "With path: adds samples until the estimated relative error is this small"));
  setting(add_integer(app, "--eye-shells", options.eye_shells, 1, 4096,
                      "With cached: steps of scattered light along an eye ray (default 16)"));
  app.add_flag("--gather-everywhere", options.gather_everywhere,
               "With cached: gather at every sample instead of asking records; slow, and without "
               "interpolation error")
      ->group("Integrator");
}

void add_output_options(CLI::App& app, CommandContext& context, RenderOptions& options) {
  const auto output = [&](CLI::Option* option) { option->group("Output"); };
  output(add_path(app, "-o,--output", options.output, "OUT.exr",
                  "Image to write (default: the scene's outputs)"));
  output(add_choice<bool>(app, "--depth", {{"half", true}, {"float", false}}, options.half_colour,
                          "Of colour layers (default half); data layers are always float"));
  output(add_parsed(
      app, "--aovs", "A,B,...", options.aovs,
      [](const std::string&, const std::string& text) { return parse_list(text); },
      "Layers to keep beside beauty (default all): diffuse_direct, diffuse_indirect, "
      "glossy_direct, "
      "glossy_indirect, volume_direct, volume_indirect, volume_emission, emission, background, Z, "
      "N, "
      "P, albedo, transmittance, cache_count, cost"));
  output(add_path(app, "--preview", options.preview, "OUT.png", "Also writes a tone-mapped PNG"));
  output(add_parsed(
      app, "--preview-layer", "NAME", options.preview_layer,
      [](const std::string&, const std::string& text) { return text == "beauty" ? "" : text; },
      "Layer of the preview (default beauty); data layers are shown in false colour"));
  output(add_parsed(
      app, "--exposure", "STOPS|auto", options.exposure,
      [](const std::string& name, const std::string& text) {
        std::optional<double> stops;
        if (text != "auto") stops = parse_number(name, text, -64, 64);
        return std::optional<std::optional<double>>(stops);
      },
      "Of the preview (default auto: the mean becomes middle grey)"));
  with_environment(context, app,
                   add_choice<ExistingPolicy>(app, "--existing",
                                              {{"overwrite", ExistingPolicy::Overwrite},
                                               {"skip", ExistingPolicy::Skip},
                                               {"error", ExistingPolicy::Error}},
                                              options.existing,
                                              "Images that are already there (default overwrite)"))
      ->group("Output");
  output(app.add_flag("--reproducible", options.reproducible,
                      "Equal inputs give equal bytes: no times, memory or command line in the "
                      "metadata; also where SOURCE_DATE_EPOCH is set"));
  with_environment(context, app,
                   add_parsed(
                       app, "--max-image-pixels", "N", options.max_pixels,
                       [](const std::string& name, const std::string& text) {
                         return std::optional<std::uint64_t>(parse_unsigned(name, text));
                       },
                       "Refuse larger images (default 2^28)"))
      ->group("Output");
}

[[noreturn]] void contradiction(const std::string& message) {
  throw Error(ErrorKind::Usage, message);
}

}  // namespace

int RenderOptions::sample_count() const {
  if (samples) return *samples;
  if (accuracy.preset) return preset_values(*accuracy.preset).samples;
  return is_path() ? kPathSamples : preset_values(Preset::Normal).samples;
}

int RenderOptions::eye_shell_count() const {
  return eye_shells.value_or(preset_values(accuracy.preset.value_or(Preset::Normal)).eye_shells);
}

FilmOptions RenderOptions::film() const { return {half_colour.value_or(true), aovs}; }

bool RenderOptions::is_reproducible() const {
  return reproducible || std::getenv("SOURCE_DATE_EPOCH") != nullptr;
}

void RenderOptions::check_size(const Size2& frame_size) const {
  const std::uint64_t limit = max_pixels.value_or(kMaxPixels);
  if (std::uint64_t(frame_size.x) * std::uint64_t(frame_size.y) > limit)
    throw Error(ErrorKind::InvalidInput, "--max-image-pixels: " + std::to_string(frame_size.x) +
                                             "x" + std::to_string(frame_size.y) +
                                             " has more than " + std::to_string(limit) +
                                             " pixels: choose a smaller --res or raise the limit");
}

void add_render_options(CLI::App& app, CommandContext& context, RenderOptions& options) {
  add_scene_options(app, context, options.scene);
  add_output_options(app, context, options);
  add_frame_options(app, context, options);
  add_integrator_options(app, context, options);
  add_path(app, "--cache", options.cache.file, "C.irc",
           "Cache file to read, and to fill with what this view needs (default: in memory)")
      ->group("Cache");
  add_cache_mode_option(app, context, options.cache);
  add_self_check_options(app, context, options.check);
  add_accuracy_options(app, context, options.accuracy);
}

void check_combinations(const RenderOptions& options) {
  require_sense(options.check);
  if (options.check.max_rmse && (options.is_path() || options.gather_everywhere || options.pixel))
    contradiction("--max-rmse: nothing that records answer for is rendered: leave it out");
  if (options.is_path()) {
    if (!options.cache.file.empty())
      contradiction(
          "--cache: path tracing reads no cache: leave it out, or use --integrator cached");
    if (options.gather_everywhere)
      contradiction("--gather-everywhere: path tracing gathers nothing: use --integrator cached");
  } else {
    if (options.transport)
      contradiction(
          "--transport: chooses the paths of --integrator path: add that, or leave it out");
    if (options.noise)
      contradiction("--noise: stops --integrator path: add that, or use --spp and --error");
  }
  if (options.pixel && options.crop)
    contradiction("--pixel: explains one pixel of the whole frame: leave out --crop");
  if (options.pixel && (!options.output.empty() || !options.preview.empty()))
    contradiction("--pixel: writes no image: leave out -o and --preview");
  if (!options.preview_layer.empty() && options.preview.empty())
    contradiction("--preview-layer: there is no preview: add --preview OUT.png");
  if (options.exposure && options.preview.empty())
    contradiction("--exposure: there is no preview: add --preview OUT.png");
  if (!options.preview.empty() && options.preview.extension() != ".png")
    contradiction("--preview: " + printable(options.preview.string()) + " is not named *.png");
  if (!options.output.empty() && options.output.extension() != ".exr")
    contradiction("-o: " + printable(options.output.string()) +
                  " is not named *.exr: pictures for people come from --preview OUT.png");
}

CropIntervals crop_of(const RenderOptions& options, const Size2& size) {
  CropRegion crop{0, 0, double(size.x), double(size.y), true};
  if (options.pixel) {
    const Size2 p = *options.pixel;
    crop = {double(p.x), double(p.y), p.x + 1.0, p.y + 1.0, true};
  } else if (options.crop) {
    crop = *options.crop;
    if (!crop.is_pixels)  // Every pixel that the region touches.
      crop = {std::floor(crop.x0 * size.x), std::floor(crop.y0 * size.y),
              std::ceil(crop.x1 * size.x), std::ceil(crop.y1 * size.y), true};
  }
  if (crop.x1 > size.x || crop.y1 > size.y)
    throw Error(ErrorKind::Usage, std::string(options.pixel ? "--pixel" : "--crop") +
                                      ": leaves the image, which is " + std::to_string(size.x) +
                                      "x" + std::to_string(size.y));
  CropIntervals result;
  // Well inside the outermost pixels, so that no rounding takes in a neighbour.
  constexpr double kInset = 0.25;
  result.x = {(crop.x0 + kInset) / size.x, (crop.x1 - kInset) / size.x};
  result.y = {(crop.y0 + kInset) / size.y, (crop.y1 - kInset) / size.y};
  result.pixels = static_cast<std::size_t>((crop.x1 - crop.x0) * (crop.y1 - crop.y0));
  return result;
}

}  // namespace brume
