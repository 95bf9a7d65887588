// brume merge: cache shards made into the cache that one process would have baked.
#include "cache/cache_journal.h"
#include "cache/cache_merge.h"
#include "cache/irradiance_cache.h"
#include "cli/commands.h"
#include "cli/outputs.h"
#include "cli/self_check.h"
#include "cli/values.h"
#include "core/error.h"

namespace brume {
namespace {

struct MergeOptions {
  std::vector<std::string> files;
  std::filesystem::path output;
};

MergeInput read_input(const std::string& file) {
  CacheOpening opening = open_cache(file, std::nullopt);
  if (opening.state != CacheState::Loaded)
    throw Error(ErrorKind::InvalidInput,
                printable(file) + ": " + opening.reason + ": leave it out, or bake it again");
  return {file, std::move(opening.contents)};
}

std::string shown_list(const std::vector<std::uint32_t>& shards, std::uint32_t count) {
  std::string list;
  for (const std::uint32_t i : shards)
    list += (list.empty() ? "" : ", ") + std::to_string(i) + "/" + std::to_string(count);
  return list;
}

int merge(const MergeOptions& options, const CommandContext& context) {
  check_writable(options.output);
  std::vector<MergeInput> inputs;
  for (const std::string& file : options.files) inputs.push_back(read_input(file));
  MergedCache merged = merge_caches(inputs);
  inputs.clear();
  const IrradianceCache cache(
      std::move(merged.records), merged.header.origin, {},
      std::make_shared<VolumeCache>(std::move(merged.volume), merged.header.origin));
  write_cache(options.output, merged.header, cache, merged.notes);

  const std::vector<std::uint32_t> missing = merged.shards.missing();
  const std::string file = printable(options.output.string());
  if (context.json) {
    Json all = Json::object();
    all["records"] = cache.size();
    all["repeated"] = merged.repeated;
    all["fingerprint"] = merged.header.fingerprint.hex();
    all["shards"] = {{"count", merged.shards.count}, {"missing", missing}};
    print_json(context, all);
  }
  context.note(file + ": " + std::to_string(cache.size()) + " records from " +
               std::to_string(options.files.size()) + " caches, " +
               std::to_string(merged.repeated) + " of them repeated");
  const AnswerCheck answers =
      summarise(read_checks(merged.notes.checks), cache.records(), cache.origin());
  if (answers.points > 0) context.note(file + ": " + check_sentence(answers));
  if (!missing.empty())
    context.warn(file + ": unfinished: missing shard" + (missing.size() > 1 ? "s " : " ") +
                 shown_list(missing, merged.shards.count) +
                 ": bake and merge them, or bake the same views into this file");
  return 0;
}

}  // namespace

void add_merge_command(CLI::App& app, CommandContext& context) {
  CLI::App* verb = app.add_subcommand("merge", "Joins cache shards, or caches of one scene");
  const auto options = std::make_shared<MergeOptions>();
  verb->add_option("CACHE", options->files, "Caches of one scene and settings, in any order")
      ->required();
  add_path(*verb, "-o,--output", options->output, "C.irc", "The cache they make")->required();
  verb->footer(
      R"(With all shards of a bake the result is, to the last bit, the cache of a bake without shards. Without
some it can be used as it is, or be completed.

Examples:
  brume merge shard*.irc -o shot.irc)");
  verb->callback([options, &context] {
    context.action = [options, &context] { return merge(*options, context); };
  });
}

}  // namespace brume
