// brume flicker: how much of what changes from frame to frame is error.
#include "cli/commands.h"
#include "cli/diff_limits.h"
#include "cli/outputs.h"
#include "cli/text_table.h"
#include "cli/values.h"
#include "core/error.h"
#include "core/image.h"
#include "study/flicker.h"

namespace brume {
namespace {

struct FlickerCommandOptions {
  std::vector<std::string> frames, references, second_references, limits;
  std::string layer = "diffuse_indirect";
  std::optional<int> block;

  bool has_reference() const { return !references.empty(); }
};

FlickerFrame read_frame(const std::string& file, const std::string& layer) {
  const ImageFile read = read_image(file);
  const Image& image = read.image;
  const auto matrix = read.metadata.find("worldToCamera");
  const auto fov = read.metadata.find("brume:fovDeg");
  const auto need = [&](bool there, const std::string& what) {
    if (!there)
      throw Error(ErrorKind::InvalidInput,
                  printable(file) + ": has no " + what +
                      ": flicker is measured on frames that `brume render` wrote with all layers");
  };
  need(matrix != read.metadata.end() &&
           std::holds_alternative<std::array<float, 16>>(matrix->second) &&
           fov != read.metadata.end() && std::holds_alternative<double>(fov->second),
       "camera in its metadata");
  FlickerFrame frame;
  frame.width = image.width;
  frame.height = image.height;
  frame.world_to_camera = std::get<std::array<float, 16>>(matrix->second);
  frame.fov_deg = std::get<double>(fov->second);
  frame.light = image.layer(layer, file);
  const auto channel = [&](const std::string& name) -> const std::vector<float>& {
    const ImageChannel* found = image.find(name);
    need(found != nullptr, "channel " + name);
    return found->values;
  };
  const auto vectors = [&](const std::string& name) {
    const auto &x = channel(name + ".X"), &y = channel(name + ".Y"), &z = channel(name + ".Z");
    std::vector<Vec3f> all;
    for (std::size_t i = 0; i < x.size(); ++i) all.emplace_back(x[i], y[i], z[i]);
    return all;
  };
  frame.position = vectors("P");
  frame.normal = vectors("N");
  frame.depth = channel("Z");
  frame.alpha = channel("A");
  return frame;
}

Metrics metrics_of(const Flicker& flicker, bool has_reference) {
  Metrics all{{"matched", flicker.matched}, {"change", flicker.change}};
  if (has_reference) {
    all.emplace_back("reference_change", flicker.reference_change);
    all.emplace_back("error_change", flicker.error_change);
  }
  return all;
}

FlickerView read_view(const FlickerCommandOptions& options, std::size_t i) {
  FlickerView view;
  view.frame = read_frame(options.frames[i], options.layer);
  for (const auto* list : {&options.references, &options.second_references})
    if (!list->empty()) view.references.push_back(read_frame((*list)[i], options.layer));
  return view;
}

// Root mean squares over the pairs; of matched the mean.
Flicker mean_of(const std::vector<Flicker>& pairs) {
  Flicker mean;
  const double n = static_cast<double>(pairs.size());
  for (const Flicker& pair : pairs) {
    mean.matched += pair.matched / n;
    for (double Flicker::*root :
         {&Flicker::change, &Flicker::reference_change, &Flicker::error_change})
      mean.*root += pair.*root * std::abs(pair.*root) / n;
  }
  for (double* square : {&mean.change, &mean.reference_change, &mean.error_change})
    *square = signed_root(*square);
  return mean;
}

Json to_json(const Metrics& metrics) {
  Json object = Json::object();
  for (const auto& [name, value] : metrics) object[name] = *value;
  return object;
}

void check(const FlickerCommandOptions& options) {
  if (options.frames.size() < 2)
    throw Error(ErrorKind::Usage, "flicker: needs two frames or more, in order");
  if (!options.second_references.empty() && !options.has_reference())
    throw Error(ErrorKind::Usage, "--second-reference: goes with --reference");
  for (const auto& [name, list] : {std::pair("--reference", &options.references),
                                   std::pair("--second-reference", &options.second_references)})
    if (!list->empty() && list->size() != options.frames.size())
      throw Error(ErrorKind::Usage, std::string(name) + ": " + std::to_string(list->size()) +
                                        " files for " + std::to_string(options.frames.size()) +
                                        " frames: name one for each");
}

int measure(const FlickerCommandOptions& options, const CommandContext& context) {
  check(options);
  const bool has_reference = options.has_reference();
  std::vector<std::string> names;
  for (const auto& [name, value] : metrics_of({}, has_reference)) names.push_back(name);
  std::vector<MetricLimit> limits;
  for (const std::string& text : options.limits) limits.push_back(parse_metric_limit(text, names));

  FlickerOptions flicker_options;
  if (options.block) flicker_options.block = *options.block;
  std::vector<Flicker> pairs;
  FlickerView view = read_view(options, 0);
  for (std::size_t i = 1; i < options.frames.size(); ++i) {
    FlickerView next = read_view(options, i);
    pairs.push_back(frame_flicker(view, next, flicker_options));
    view = std::move(next);
  }
  const Metrics all = metrics_of(mean_of(pairs), has_reference);

  if (context.json) {
    Json object = to_json(all);
    object["pairs"] = Json::array();
    for (const Flicker& pair : pairs)
      object["pairs"].push_back(to_json(metrics_of(pair, has_reference)));
    print_json(context, object);
  } else {
    std::vector<std::vector<std::string>> rows{{"from frame"}};
    for (const std::string& name : names) rows[0].push_back(name + " %");
    const auto add_row = [&](const std::string& title, const Metrics& metrics) {
      rows.push_back({title});
      for (const auto& [name, value] : metrics) rows.back().push_back(shown_number(100 * *value));
    };
    for (std::size_t i = 0; i < pairs.size(); ++i)
      add_row(std::to_string(i) + " to " + std::to_string(i + 1),
              metrics_of(pairs[i], has_reference));
    add_row("all", all);
    print_table(context.out, rows);
  }
  if (const std::string over = metrics_over(all, limits); !over.empty())
    throw Error(ErrorKind::Threshold,
                printable(options.frames[0]) + " and those after it: " + over);
  return 0;
}

}  // namespace

void add_flicker_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb = app.add_subcommand(
      "flicker", "Measures how light on surfaces changes from frame to frame of a moving camera");
  const auto options = std::make_shared<FlickerCommandOptions>();
  verb->add_option("FRAMES", options->frames, "EXR frames of one static scene, in order")
      ->required();
  verb->add_option("--reference", options->references,
                   "Frames of the same cameras to judge against, in the same order")
      ->type_name("FILE ...");
  verb->add_option("--second-reference", options->second_references,
                   "References of another seed: with two, their noise does not count as flicker")
      ->type_name("FILE ...");
  verb->add_option("--layer", options->layer, "Layer to judge (default: diffuse_indirect)")
      ->type_name("NAME");
  add_integer(*verb, "--block", options->block, 1, 4096,
              "Pixels a side of the blocks whose means are compared (default 8)");
  verb->add_option("--fail-above", options->limits,
                   "Exit with 5 if METRIC of all frames is above V; may be repeated")
      ->type_name("METRIC=V")
      ->allow_extra_args(false);
  verb->footer(
      R"(Each surface point that two frames in turn both see is looked up in both. change is the root mean
square of what its light changes, over means of blocks; error_change that of the change of (frame -
reference), which is flicker; below 0 it is lost in the noise of two references. Both are relative to the mean (docs/flicker.md).

Examples:
  brume flicker shot.*.exr
  brume flicker shot.*.exr --reference reference.*.exr --fail-above error_change=0.01)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return measure(*options, context); };
  });
}

}  // namespace brume
