// brume filter: some of a cache's records, as a cache that says it is a part.
#include <charconv>
#include <fstream>

#include "cache/cache_copy.h"
#include "cache/record_filter.h"
#include "cli/cache_input.h"
#include "cli/commands.h"
#include "cli/outputs.h"
#include "cli/values.h"
#include "core/error.h"

namespace brume {
namespace {

struct FilterOptions {
  std::filesystem::path input, output;
  RecordFilter filter;
  std::optional<double> spacing;
  bool is_salvage = false;
};

// "A:B" cut in two, "A" twice; one end may be left out.
std::pair<std::string, std::string> parse_ends(const std::string& text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) return {text, text};
  return {text.substr(0, colon), text.substr(colon + 1)};
}

std::optional<IntegerRange> parse_integers(const std::string& option, const std::string& text) {
  const auto [first, last] = parse_ends(text);
  IntegerRange range;
  if (!first.empty()) range.first = static_cast<int>(parse_integer(option, first, 0, 255));
  if (!last.empty()) range.last = static_cast<int>(parse_integer(option, last, 0, 255));
  if (range.first > range.last) refuse_value(option, text, "a range that rises, like 0:3");
  return range;
}

std::optional<NumberRange> parse_numbers(const std::string& option, const std::string& text) {
  const auto [least, most] = parse_ends(text);
  NumberRange range;
  if (!least.empty()) range.least = parse_number(option, least, 0, 1e300);
  if (!most.empty()) range.most = parse_number(option, most, 0, 1e300);
  if (range.least > range.most) refuse_value(option, text, "a range that rises, like 0.1:0.5");
  return range;
}

std::optional<Box3d> parse_box(const std::string& option, const std::string& text) {
  const std::vector<std::string> numbers = parse_list(text);
  if (numbers.size() != 6) refuse_value(option, text, "two corners, like 0,0,0,1,2,3");
  Box3d box;
  for (std::size_t i = 0; i < 6; ++i) {
    const double value = parse_number(option, numbers[i], -1e300, 1e300);
    (i < 3 ? box.min : box.max)[static_cast<int>(i % 3)] = value;
  }
  if (box.isEmpty()) refuse_value(option, text, "the lower corner before the upper one");
  return box;
}

// "K,K,...", or "@FILE" with keys between commas, blanks or lines.
std::vector<std::uint64_t> parse_keys(const std::string& option, const std::string& text) {
  std::string list = text;
  if (!text.empty() && text[0] == '@') {
    std::ifstream stream(text.substr(1), std::ios::binary);
    list.assign(std::istreambuf_iterator<char>(stream), {});
    if (!stream) refuse_value(option, text, "a file that can be read after the @");
    std::replace_if(
        list.begin(), list.end(), [](char c) { return c == '\n' || c == '\r' || c == ' '; }, ',');
  }
  std::vector<std::uint64_t> keys;
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    const std::string key = list.substr(begin, end - begin);
    begin = end + 1;
    if (key.empty()) continue;
    std::uint64_t value = 0;
    const auto [stopped, problem] = std::from_chars(key.data(), key.data() + key.size(), value, 16);
    if (problem != std::errc() || stopped != key.data() + key.size())
      refuse_value(option, key, "keys of records, 16 hexadecimal digits each");
    keys.push_back(value);
  }
  if (keys.empty()) refuse_value(option, text, "at least one key");
  return keys;
}

// What there is to choose from; --salvage takes what a damaged file still holds.
CacheContents read_input(const FilterOptions& options, const CommandContext& context) {
  if (!options.is_salvage) return read_cache_contents(options.input);
  CacheCheck check = check_cache(options.input);
  if (check.opening.state == CacheState::Loaded) return std::move(check.opening.contents);
  if (check.opening.state != CacheState::Corrupt || check.valid_bytes == 0)
    throw Error(ErrorKind::InvalidInput, printable(options.input.string()) + ": " +
                                             check.opening.reason + ": nothing is left of it");
  context.warn(printable(options.input.string()) + ": " + check.opening.reason);
  CacheContents contents = std::move(check.opening.contents);
  // Deep records are all there or none of them counts: they come first, so without top records some
  // may be lost.
  if (contents.records.empty() || contents.records.back().layer() != kTopLayer) {
    contents.records.clear();
    contents.volume = {};
    contents.notes = {};
  }
  return contents;
}

int filter(const FilterOptions& options, const CommandContext& context) {
  check_writable(options.output);
  CacheContents contents = read_input(options, context);
  // A damaged cache is a part whatever its records say: some of them may be missing.
  const bool is_whole = contents.is_complete;
  const std::size_t before = contents.records.size() + contents.volume.size();
  RecordFilter choice = options.filter;
  choice.spacing = options.spacing;
  choice.top_layer = kTopLayer;
  choice.is_part = !is_whole;
  FilteredCache filtered = filter_records(std::move(contents), choice);
  const std::size_t kept = filtered.contents.records.size() + filtered.contents.volume.size();
  write_cache_contents(options.output, std::move(filtered.contents));

  const std::string output = printable(options.output.string());
  if (context.json) {
    Json result = Json::object();
    result["records"] = kept;
    result["dropped"] = filtered.dropped;
    result["partial"] = filtered.is_part;
    result["resumable"] = !filtered.lacks_deeper_layers;
    print_json(context, result);
  } else {
    context.note(output + ": " + std::to_string(kept) + " of " + std::to_string(before) +
                 " records");
  }
  if (filtered.lacks_deeper_layers)
    context.warn(output +
                 ": without all of the deep records no bake can go on from it: it has another "
                 "fingerprint, for inspect, diff and convert alone");
  return 0;
}

void add_criteria(CLI::App& verb, FilterOptions& options) {
  RecordFilter& filter = options.filter;
  const auto criterion = [](CLI::Option* option) { option->group("Criteria"); };
  criterion(add_parsed(verb, "--box", "X0,Y0,Z0,X1,Y1,Z1", filter.box, parse_box,
                       "Between these corners, in scene units"));
  criterion(add_parsed(verb, "--layer", "A[:B]", filter.layers, parse_integers,
                       "Of these layers (0: deep records, that gathers ask, with those of the medium "
                       "as they are; 1: top records, that eye rays ask) and none of others (default: the criteria choose among top "
                       "records, and deep ones stay whole)"));
  criterion(add_parsed(verb, "--wave", "A[:B]", filter.waves, parse_integers, "Of these waves"));
  criterion(add_parsed(verb, "--radius", "A[:B]", filter.radius, parse_numbers,
                       "With a radius in this range, in scene units; an end may be left out"));
  criterion(add_parsed(verb, "--relative-error", "A[:B]", filter.relative_error, parse_numbers,
                       "With an error over irradiance in this range"));
  criterion(add_parsed(verb, "--irradiance", "A[:B]", filter.luminance, parse_numbers,
                       "With a luminance of irradiance in this range, in W/m^2"));
  criterion(add_parsed(verb, "--keys", "K,...|@FILE", filter.keys, parse_keys,
                       "With one of these keys, 16 hexadecimal digits each"));
  criterion(
      verb.add_flag("--invert", filter.is_inverted, "Drops what the criteria choose instead"));
}

}  // namespace

void add_filter_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb =
      app.add_subcommand("filter", "Keeps some of a cache's records: chosen, thinned, salvaged");
  const auto options = std::make_shared<FilterOptions>();
  verb->add_option_function<std::string>(
          "CACHE", [options](const std::string& text) { options->input = text; }, "Cache file")
      ->required();
  add_path(*verb, "-o,--output", options->output, "D.irc", "Cache file to write")->required();
  add_criteria(*verb, *options);
  add_number(*verb, "--thin", options->spacing, 1e-9, 1e9,
             "Then drops records closer than this to one kept before, on one side and layer, in "
             "scene units; coarse waves stay");
  verb->add_flag("--salvage", options->is_salvage,
                 "Takes what is left of a damaged or unfinished cache, without bad records");
  verb->footer(
      R"(A record is kept where all criteria hold. What is left is a valid cache that says it is a part:
renders read it, and `brume bake` with --cache-mode missing fills what is missing again.

Examples:
  brume filter shot.irc -o left.irc --box -1,0,-1,0,2,1
  brume filter shot.irc -o good.irc --relative-error :0.2
  brume filter shot.irc -o coarse.irc --thin 0.1
  brume filter broken.irc -o rest.irc --salvage)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return filter(*options, context); };
  });
}

}  // namespace brume
