// brume inspect: what a cache or a .vdb file holds, known by its first bytes.
#include "cli/commands.h"
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
  SceneOptions grids;
  InspectCacheOptions cache;
  std::optional<double> min_radius;

  bool has_cache_options() const {
    return cache.records || cache.at || cache.normal || cache.layer || cache.deep || min_radius;
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
    inspect_grids(options.file, options.grids.file_options().grids, context);
    return 0;
  }
  InspectCacheOptions cache = options.cache;
  cache.min_radius = options.min_radius.value_or(0);
  return inspect_cache(options.file, cache, context);
}

void add_cache_options(CLI::App& verb, InspectOptions& options) {
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
                       "Lists the records that answer at this point, with their weights"));
  of_caches(add_parsed(verb, "--normal", "X,Y,Z", options.cache.normal, vector,
                       "With --at: the side that receives (default: that of the nearest record)"));
  of_caches(add_integer(verb, "--layer", options.cache.layer, 0, kMaxBounces,
                        "With --at: which bounce (default: the one that eye rays ask)"));
  of_caches(add_number(verb, "--min-radius", options.min_radius, 0, 1e9,
                       "With --at: records act as if at least this wide, in scene units"));
  of_caches(verb.add_flag("--deep", options.cache.deep,
                          "Checks every byte and value, and shows what precedes any damage"));
}

}  // namespace

void add_inspect_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb = app.add_subcommand("inspect", "Shows what a cache or a .vdb file holds");
  const auto options = std::make_shared<InspectOptions>();
  verb->add_option_function<std::string>(
          "FILE", [options](const std::string& text) { options->file = text; },
          "A cache or a .vdb file, known by its first bytes")
      ->required();
  add_cache_options(*verb, *options);
  add_grid_options(*verb, context, options->grids);
  verb->footer(R"(Examples:
  brume inspect shot.irc --deep
  brume inspect shot.irc --at 0,0.5,0 --json
  brume inspect smoke.vdb)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return inspect(*options, context); };
  });
}

}  // namespace brume
