#include "cli/diff_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>

#include "cli/diff_caches.h"
#include "cli/diff_limits.h"
#include "cli/file_magic.h"
#include "cli/outputs.h"
#include "cli/text_table.h"
#include "core/error.h"
#include "core/image.h"
#include "render/false_colour.h"
#include "study/metrics.h"

namespace brume {
namespace {

struct DiffOptions {
  std::string a, b, layer;
  std::string heat_map, flip_map;
  std::vector<std::string> fail_above;
  int blocks = 0;
};

const std::vector<std::string>& metric_names() {
  static const std::vector<std::string> names{"mae", "rmse", "relmse",     "signed_mean",
                                              "p99", "flip", "max", "block_nrmse"};
  return names;
}

void write_picture(const std::string& file, const Picture& p) {
  write_png(file, p.width, p.height, p.srgb);
}

// Symmetric about 0, wide enough for 99 % of the pixels.
Picture heat_map(const std::vector<float>& relative, int width, int height, const std::string& layer) {
  std::vector<float> size(relative.size());
  std::transform(relative.begin(), relative.end(), size.begin(), [](float v) { return std::abs(v); });
  const auto at = size.begin() + std::lround(0.99 * static_cast<double>(size.size() - 1));
  std::nth_element(size.begin(), at, size.end());
  const double range = std::isfinite(*at) && *at > 0 ? double(*at) : 1e-3;
  return false_colour(relative, width, height,
                      {ColourMap::Diverging, -range, range, "(A-B)/B " + layer});
}

// Two caches, told by either: then the other must be one.
bool names_caches(const DiffOptions& options) {
  if (!has_cache_magic(options.a) && !has_cache_magic(options.b)) return false;
  if (!options.layer.empty() || !options.heat_map.empty() || !options.flip_map.empty() ||
      options.blocks > 0)
    throw Error(ErrorKind::Usage, printable(options.a) +
                                      ": of two caches there are no images: leave out --layer, "
                                      "--heat-map, --flip-map and --blocks");
  return true;
}

int run_diff(const DiffOptions& options, const CommandContext& context) {
  if (names_caches(options)) return diff_caches(options.a, options.b, options.fail_above, context);
  std::vector<MetricLimit> limits;
  for (const std::string& text : options.fail_above) {
    limits.push_back(parse_metric_limit(text, metric_names()));
    if (limits.back().metric == "block_nrmse" && options.blocks == 0)
      throw Error(ErrorKind::Usage, "--fail-above block_nrmse: needs --blocks N");
  }

  const Image a = read_image(options.a).image, b = read_image(options.b).image;
  if (a.width != b.width || a.height != b.height) {
    const auto size = [](const Image& i) { return std::to_string(i.width) + "x" + std::to_string(i.height); };
    throw Error(ErrorKind::InvalidInput, printable(options.a) + ": " + size(a) + " pixels, but " +
                                             printable(options.b) + " has " + size(b) +
                                             ": only images of one size can be compared");
  }
  const std::vector<Rgb> colour_a = a.layer(options.layer, options.a),
                         colour_b = b.layer(options.layer, options.b);
  const DifferenceMap map = compare_images(colour_a, colour_b, a.width, a.height);
  const ImageDifference& n = map.numbers;
  Metrics metrics{{"mae", n.mae}, {"rmse", n.rmse}, {"relmse", n.relmse}, {"signed_mean", n.signed_mean},
                  {"p99", n.p99}, {"flip", n.flip}, {"max", n.max}};
  if (options.blocks > 0)
    metrics.emplace_back("block_nrmse",
                         block_nrmse(colour_a, colour_b, a.width, a.height, options.blocks));

  const std::string shown = options.layer.empty() ? "beauty" : options.layer;
  if (!options.heat_map.empty())
    write_picture(options.heat_map, heat_map(map.relative, a.width, a.height, shown));
  if (!options.flip_map.empty())
    write_picture(options.flip_map, false_colour(map.flip, a.width, a.height,
                                                 {ColourMap::Sequential, 0, 1, "FLIP " + shown}));

  if (context.json) {
    Json object = Json::object();
    for (const auto& [name, value] : metrics) object[name] = *value;
    print_json(context, object);
  } else {
    for (const auto& [name, value] : metrics)
      context.out << name << std::string(13 - name.size(), ' ') << shown_number(*value) << '\n';
  }

  const std::string over = metrics_over(metrics, limits);
  if (!over.empty())
    throw Error(ErrorKind::Threshold, printable(options.a) + ": " + shown + ": " + over +
                                          ": compared with " + printable(options.b));
  return 0;
}

}  // namespace

void add_diff_command(CLI::App& app, CommandContext& context) {
  const auto options = std::make_shared<DiffOptions>();
  CLI::App* verb = app.add_subcommand(
      "diff", "Measures how far A is from the reference B: two images, or two caches");
  verb->add_option("A", options->a, "Image to judge (EXR, HDR, PNG, PFM, TIFF), or a cache")
      ->required();
  verb->add_option("B", options->b, "Reference: an image of the same size, or a cache")->required();
  verb->add_option("--layer", options->layer, "Images: layer to compare (default: beauty)")
      ->type_name("NAME");
  verb->add_option("--heat-map", options->heat_map,
                   "Images: write the signed relative difference as a PNG with a legend")
      ->type_name("PNG");
  verb->add_option("--flip-map", options->flip_map,
                   "Images: write the FLIP error as a PNG with a legend")
      ->type_name("PNG");
  verb->add_option("--fail-above", options->fail_above,
                   "Exit with 5 if METRIC is above V; may be repeated")
      ->type_name("METRIC=V")
      ->allow_extra_args(false);
  verb->add_option("--blocks", options->blocks,
                   "Images: also compare means of N x N pixels (block_nrmse), which leaves bias "
                   "and drops noise")
      ->type_name("N")
      ->check(CLI::Range(1, 65536));
  verb->footer(
      R"(Of caches, records are the same one where layer and key agree: only_a, only_b, equal and different count
them, mae to max tell of irradiance where both have it, gradient_rmse and radius_rmse of the rest; answers_*
compare what A answers with the records of B, whatever their keys. All but the counts are relative to B's mean.

Examples:
  brume diff a.irc b.irc --fail-above different=0 --fail-above only_b=0
  brume diff shot.exr reference.exr
  brume diff shot.exr reference.exr --layer diffuse_indirect --fail-above relmse=0.01 --json)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return run_diff(*options, context); };
  });
}

}  // namespace brume
