// brume inspect: what a cache or a .vdb file holds, known by its first bytes.
#include "cli/commands.h"
#include "cli/environment.h"
#include "cli/file_magic.h"
#include "cli/inspect_cache.h"
#include "cli/inspect_grids.h"
#include "cli/outputs.h"
#include "cli/shared_options.h"
#include "cli/values.h"
#include "core/error.h"

namespace brume {
namespace {

struct InspectOptions {
  std::filesystem::path file;
  SceneOptions scene;  // Of a .vdb file only limits and policies.
  InspectCacheOptions cache;
  std::optional<double> min_radius;

  bool has_cache_options() const {
    return cache.records || cache.at || cache.normal || cache.layer || cache.deep || min_radius ||
           !cache.html.empty() || !scene.file.empty();
  }
};

// "A:B": records [A, B).
std::pair<std::size_t, std::size_t> parse_records(const std::string& option,
                                                  const std::string& text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) refuse_value(option, text, "a range, like 0:10");
  const std::uint64_t begin = parse_unsigned(option, text.substr(0, colon));
  const std::uint64_t end = parse_unsigned(option, text.substr(colon + 1));
  if (begin >= end) refuse_value(option, text, "a range with something in it, like 0:10");
  return {begin, end};
}

int inspect(const InspectOptions& options, CommandContext& context) {
  std::error_code ignored;
  if (!std::filesystem::exists(options.file, ignored))
    throw Error(ErrorKind::InvalidInput,
                printable(options.file.string()) + ": does not exist: check the name");
  if (names_a_grid_file(options.file)) {
    if (options.has_cache_options())
      throw Error(ErrorKind::Usage, printable(options.file.string()) +
                                        ": is a .vdb file: leave out the options for caches");
    inspect_grids(options.file, options.scene.file_options().grids, context);
    return 0;
  }
  InspectCacheOptions cache = options.cache;
  cache.min_radius = options.min_radius.value_or(0);
  if (cache.html.empty() && !cache.at && !options.scene.file.empty())
    throw Error(ErrorKind::Usage, printable(options.scene.file.string()) +
                                      ": a scene is for pages and points: add --html FILE or "
                                      "--at X,Y,Z");
  return inspect_cache(options.file, cache, options.scene, context);
}

void add_cache_options(CLI::App& verb, CommandContext& context, InspectOptions& options) {
  const auto of_caches = [](CLI::Option* option) { option->group("Caches"); };
  const auto vector = [](const std::string& option, const std::string& text) {
    return std::optional<Vec3d>(parse_vector(option, text));
  };
  of_caches(add_parsed(
      verb, "--records", "A:B", options.cache.records,
      [](const std::string& option, const std::string& text) {
        return std::optional<std::pair<std::size_t, std::size_t>>(parse_records(option, text));
      },
      "Lists these records"));
  of_caches(add_parsed(verb, "--at", "X,Y,Z", options.cache.at, vector,
                       "Lists the records that answer at this point, with their weights; with "
                       "SCENE, without those that its surfaces hide"));
  of_caches(add_parsed(verb, "--normal", "X,Y,Z", options.cache.normal, vector,
                       "With --at: the side that receives (default: that of the nearest record)"));
  of_caches(add_integer(verb, "--layer", options.cache.layer, 0, kTopLayer,
                        "With --at: which layer: 0 deep records, 1 top ones (default: the "
                        "highest there is)"));
  of_caches(add_number(verb, "--min-radius", options.min_radius, 0, 1e9,
                       "With --at: records act as if at least this wide, in scene units"));
  of_caches(verb.add_flag("--deep", options.cache.deep,
                          "Checks every byte and value, and shows what precedes any damage"));
  of_caches(add_path(verb, "--html", options.cache.html, "FILE",
                     "Also writes a page with a 3-D view of the records, over SCENE's surfaces if "
                     "one is named"));
  of_caches(with_environment(context, verb,
                             add_path(verb, "--three-js", options.cache.three_js, "FILE",
                                      "With --html: three.min.js to put into the page (default: "
                                      "the package libjs-three)")));
}

}  // namespace

void add_inspect_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb = app.add_subcommand("inspect", "Shows what a cache or a .vdb file holds");
  const auto options = std::make_shared<InspectOptions>();
  verb->add_option_function<std::string>(
          "FILE", [options](const std::string& text) { options->file = text; },
          "A cache or a .vdb file, known by its first bytes")
      ->required();
  add_scene_options(*verb, context, options->scene, SceneArgument::Optional);
  add_cache_options(*verb, context, *options);
  verb->footer(R"(Examples:
  brume inspect shot.irc --deep
  brume inspect shot.irc shot.json --at 0,0.5,0 --json
  brume inspect shot.irc shot.json --html shot.html
  brume inspect smoke.vdb)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return inspect(*options, context); };
  });
}

}  // namespace brume
