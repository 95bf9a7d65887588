// brume convert: caches to and from the files of other programs.
#include <algorithm>

#include "cache/cache_copy.h"
#include "cli/cache_input.h"
#include "cli/commands.h"
#include "cli/file_magic.h"
#include "cli/outputs.h"
#include "cli/values.h"
#include "core/error.h"
#include "exchange/record_points.h"
#include "exchange/splat.h"
#include "exchange/text_records.h"

namespace brume {
namespace {

enum class Target { Cache, Csv, JsonLines, Ply, Vdb };

const std::vector<std::pair<std::string, Target>>& target_names() {
  static const std::vector<std::pair<std::string, Target>> names{{"irc", Target::Cache},
                                                                 {"csv", Target::Csv},
                                                                 {"jsonl", Target::JsonLines},
                                                                 {"ply", Target::Ply},
                                                                 {"vdb", Target::Vdb}};
  return names;
}

struct ConvertOptions {
  std::filesystem::path input, output;
  std::optional<Target> target;
  std::optional<int> layer;
  bool all_layers = false;
  bool is_splat = false;
  std::optional<double> voxel, white;
};

Target target_of(const ConvertOptions& options) {
  if (options.target) return *options.target;
  std::string extension = options.output.extension().string();
  if (!extension.empty()) extension.erase(0, 1);
  if (extension == "ndjson") return Target::JsonLines;
  for (const auto& [name, target] : target_names())
    if (name == extension) return target;
  throw Error(ErrorKind::Usage, printable(options.output.string()) +
                                    ": its ending is not irc, csv, jsonl, ply or vdb: say which "
                                    "with --to");
}

// What only some targets understand is refused for the others, before anything is read.
void check(const ConvertOptions& options, Target target) {
  const auto refuse = [](const std::string& what) { throw Error(ErrorKind::Usage, what); };
  const bool is_export = target == Target::Ply || target == Target::Vdb;
  if (!is_export && (options.layer || options.all_layers))
    refuse("--layer: text holds every record; choose some with `brume filter`");
  if (options.layer && options.all_layers) refuse("--layer, --all-layers: give one of them");
  if (options.is_splat && target != Target::Vdb) refuse("--splat: makes a .vdb: name one with -o");
  if (options.is_splat != options.voxel.has_value())
    refuse(options.is_splat ? "--splat: needs --voxel H, the size of a voxel in scene units"
                            : "--voxel: goes with --splat");
  if (options.white && target != Target::Ply) refuse("--white: only PLY holds colours for the eye");
}

// Exports show one layer unless asked: records of several lie in the same places.
std::size_t choose_layer(const ConvertOptions& options, CacheContents& contents) {
  if (options.all_layers) return contents.records.size();
  const int layer = options.layer.value_or(kTopLayer);
  std::erase_if(contents.records, [&](const SurfaceRecord& r) { return r.layer() != layer; });
  return contents.records.size();
}

int convert(const ConvertOptions& options, const CommandContext& context) {
  const Target target = target_of(options);
  check(options, target);
  check_writable(options.output);
  CacheContents contents = text_format_of(options.input) ? read_text_records(options.input)
                                                         : read_cache_contents(options.input);
  Json result = Json::object();
  std::size_t count = contents.records.size();
  if (target != Target::Cache && contents.volume.size() > 0)
    context.warn(printable(options.output.string()) + ": without the " +
                 std::to_string(contents.volume.size()) +
                 " records of the medium: only .irc holds them");
  if (target == Target::Cache) count += contents.volume.size();
  switch (target) {
    case Target::Cache:
      write_cache_contents(options.output, std::move(contents));
      break;
    case Target::Csv:
    case Target::JsonLines:
      write_text_records(options.output,
                         target == Target::Csv ? TextFormat::Csv : TextFormat::JsonLines, contents);
      break;
    case Target::Ply:
      count = choose_layer(options, contents);
      for (const std::string& warning :
           write_ply(options.output, contents, {options.white.value_or(0)}))
        context.warn(warning);
      break;
    case Target::Vdb:
      count = choose_layer(options, contents);
      if (options.is_splat)
        result["voxels"] = write_splat(options.output, contents, {*options.voxel}).voxels;
      else
        write_vdb_points(options.output, contents);
      break;
  }
  result["file"] = options.output.string();
  result["records"] = count;
  if (context.json)
    print_json(context, result);
  else
    context.note(printable(options.output.string()) + ": " + std::to_string(count) + " records" +
                 (result.contains("voxels") ? " in " + result["voxels"].dump() + " voxels" : ""));
  return 0;
}

}  // namespace

void add_convert_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb = app.add_subcommand(
      "convert", "Turns a cache into CSV, JSON lines, PLY or OpenVDB, and text back into a cache");
  const auto options = std::make_shared<ConvertOptions>();
  verb->add_option_function<std::string>(
          "IN", [options](const std::string& text) { options->input = text; },
          "A cache, or what this verb wrote as CSV or JSON lines, known by its first bytes")
      ->required();
  add_path(*verb, "-o,--output", options->output, "OUT",
           "File to write; its ending (irc, csv, jsonl, ply, vdb) says what")
      ->required();
  add_choice<Target>(*verb, "--to", target_names(), options->target,
                     "What to write, whatever the file's ending");
  const auto of_points = [](CLI::Option* option) { option->group("PLY and OpenVDB"); };
  of_points(add_integer(*verb, "--layer", options->layer, 0, 255,
                        "Records of this layer: 0 deep, that gathers ask; 1 top, that eye rays "
                        "ask (default)"));
  of_points(verb->add_flag("--all-layers", options->all_layers, "Records of both layers"));
  of_points(add_number(*verb, "--white", options->white, 1e-30, 1e30,
                       "PLY: radiance of white paper that is shown as white (default: such that "
                       "the mean is middle grey)"));
  of_points(verb->add_flag("--splat", options->is_splat,
                           "OpenVDB: no points but voxels, grids irradiance, weight and count"));
  of_points(add_number(*verb, "--voxel", options->voxel, 1e-6, 1e6,
                       "With --splat: size of a voxel in scene units"));
  verb->footer(
      R"(Text keeps every bit of surface records: from CSV or JSON lines the same cache comes back. Records of the
medium stay in caches. Points have their normals,
colours, radii, gradients and errors as attributes (docs/exchange.md).

Examples:
  brume convert shot.irc -o shot.csv
  brume convert shot.jsonl -o shot.irc
  brume convert shot.irc -o shot.ply
  brume convert shot.irc -o light.vdb --splat --voxel 0.05)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return convert(*options, context); };
  });
}

}  // namespace brume
