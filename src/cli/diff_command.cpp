#include "cli/diff_command.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <utility>

#include "cli/outputs.h"
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

using Metrics = std::vector<std::pair<std::string, double>>;

struct Limit {
  std::string metric;
  double value = 0;
};

const std::vector<std::string>& metric_names() {
  static const std::vector<std::string> names{"mae", "rmse", "relmse",     "signed_mean",
                                              "p99", "flip", "max", "block_nrmse"};
  return names;
}

Limit parse_limit(const std::string& text, bool has_blocks) {
  const std::size_t equals = text.find('=');
  Limit limit{text.substr(0, equals), 0};
  const std::string number = equals == std::string::npos ? "" : text.substr(equals + 1);
  const char* const end = number.data() + number.size();
  const auto [stopped, problem] = std::from_chars(number.data(), end, limit.value);
  if (problem != std::errc() || stopped != end || !(limit.value >= 0))
    throw Error(ErrorKind::Usage, "--fail-above: '" + printable(text, 60) +
                                      "' does not read METRIC=V with V at least 0");
  const auto& names = metric_names();
  if (std::find(names.begin(), names.end(), limit.metric) == names.end()) {
    std::string list;
    for (const std::string& n : names) list += (list.empty() ? "" : ", ") + n;
    throw Error(ErrorKind::Usage, "--fail-above: no metric is called '" + printable(limit.metric, 60) +
                                      "': choose from " + list);
  }
  if (limit.metric == "block_nrmse" && !has_blocks)
    throw Error(ErrorKind::Usage, "--fail-above block_nrmse: needs --blocks N");
  return limit;
}

std::string number_text(double v) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", v);
  return text;
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

int run_diff(const DiffOptions& options, const CommandContext& context) {
  std::vector<Limit> limits;
  for (const std::string& text : options.fail_above)
    limits.push_back(parse_limit(text, options.blocks > 0));

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
    for (const auto& [name, value] : metrics) object[name] = value;
    print_json(context, object);
  } else {
    for (const auto& [name, value] : metrics)
      context.out << name << std::string(13 - name.size(), ' ') << number_text(value) << '\n';
  }

  std::string over;
  for (const Limit& limit : limits) {
    const double value =
        std::find_if(metrics.begin(), metrics.end(), [&](const auto& m) { return m.first == limit.metric; })
            ->second;
    // Either way round is a difference; not-a-number is never within a limit.
    if (std::abs(value) <= limit.value) continue;
    over += (over.empty() ? "" : ", ") + limit.metric + " " + number_text(value) + " is above " +
            number_text(limit.value);
  }
  if (!over.empty())
    throw Error(ErrorKind::Threshold, printable(options.a) + ": " + shown + ": " + over +
                                          ": compared with " + printable(options.b));
  return 0;
}

}  // namespace

void add_diff_command(CLI::App& app, CommandContext& context) {
  const auto options = std::make_shared<DiffOptions>();
  CLI::App* verb = app.add_subcommand("diff", "Measure how far image A is from the reference B");
  verb->add_option("A", options->a, "Image to judge (EXR, HDR, PNG, PFM, TIFF)")->required();
  verb->add_option("B", options->b, "Reference of the same size")->required();
  verb->add_option("--layer", options->layer, "Layer to compare (default: beauty)")->type_name("NAME");
  verb->add_option("--heat-map", options->heat_map,
                   "Write the signed relative difference as a PNG with a legend")
      ->type_name("PNG");
  verb->add_option("--flip-map", options->flip_map, "Write the FLIP error as a PNG with a legend")
      ->type_name("PNG");
  verb->add_option("--fail-above", options->fail_above,
                   "Exit with 5 if METRIC is above V; may be repeated")
      ->type_name("METRIC=V")
      ->allow_extra_args(false);
  verb->add_option("--blocks", options->blocks,
                   "Also compare means of N x N pixels (block_nrmse), which leaves bias and drops noise")
      ->type_name("N")
      ->check(CLI::Range(1, 65536));
  verb->footer(R"(Examples:
  brume diff shot.exr reference.exr
  brume diff shot.exr reference.exr --layer diffuse_indirect --fail-above relmse=0.01 --json)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return run_diff(*options, context); };
  });
}

}  // namespace brume
