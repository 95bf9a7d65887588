#include "cache/cache_merge.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <set>

#include "cache/answer_check.h"
#include "core/error.h"

namespace brume {
namespace {

struct Held {
  const SurfaceRecord* record;
  const MergeInput* input;
};

// A record that one bake left unfinished is the same one that another finished.
bool is_same(SurfaceRecord a, SurfaceRecord b) {
  a.flags &= ~kUnfinishedViewFlag;
  b.flags &= ~kUnfinishedViewFlag;
  return std::memcmp(&a, &b, sizeof a) == 0;
}

std::string name(const MergeInput& input) { return printable(input.file.string()); }

[[noreturn]] void refuse(const MergeInput& a, const MergeInput& b, const std::string& what) {
  throw Error(ErrorKind::InvalidInput, name(a) + ": " + name(b) + ": " + what);
}

[[noreturn]] void refuse_conflict(const Held& a, const Held& b) {
  char key[20];
  std::snprintf(key, sizeof key, "%016llx", static_cast<unsigned long long>(a.record->key));
  refuse(*a.input, *b.input,
         "key " + std::string(key) + " of layer " + std::to_string(a.record->layer()) + ", wave " +
             std::to_string(a.record->wave()) +
             ": the records differ: one of them was made by another build or a broken machine: "
             "bake again");
}

ShardSet union_of_shards(const std::vector<MergeInput>& inputs) {
  const MergeInput* first = nullptr;
  std::set<std::uint32_t> done;
  for (const MergeInput& input : inputs) {
    const ShardSet& shards = input.contents.header.shards;
    if (shards.count == 0) continue;
    if (!first) first = &input;
    const ShardSet& others = first->contents.header.shards;
    if (shards.count != others.count)
      refuse(*first, input,
             "shards of " + std::to_string(others.count) + " and of " +
                 std::to_string(shards.count) + ": merge shards of one bake");
    if (shards.request != others.request)
      refuse(*first, input, "shards of bakes for other views or sizes: merge shards of one bake");
    done.insert(shards.done.begin(), shards.done.end());
  }
  if (!first) return {};
  const ShardSet& shards = first->contents.header.shards;
  return {shards.request, shards.count, {done.begin(), done.end()}};
}

// Deep records are solved for together, so those of the medium come whole, and the same in each input
// that holds any.
void merge_volumes(const std::vector<MergeInput>& inputs, MergedCache& merged) {
  const MergeInput* first = nullptr;
  for (const MergeInput& input : inputs) {
    const CacheContents& contents = input.contents;
    if (contents.volume.size() == 0 && contents.notes.solve.empty()) continue;
    if (!first) {
      first = &input;
      merged.volume = contents.volume;
      merged.notes.solve = contents.notes.solve;
    } else if (!(contents.volume == merged.volume) || contents.notes.solve != merged.notes.solve) {
      refuse(*first, input,
             "the records of the medium, or the solve for their light, differ: one of them was made "
             "by another build or a broken machine: bake again");
    } else {
      merged.repeated += contents.volume.size();
    }
  }
}

}  // namespace

void mark_finished(std::vector<SurfaceRecord>& records) {
  for (SurfaceRecord& record : records) record.flags &= ~kUnfinishedViewFlag;
}

MergedCache merge_caches(const std::vector<MergeInput>& inputs) {
  MergedCache merged;
  const CacheHeader& header = inputs.front().contents.header;
  std::vector<Held> all;
  for (const MergeInput& input : inputs) {
    const CacheHeader& other = input.contents.header;
    if (other.fingerprint != header.fingerprint || other.settings != header.settings ||
        other.origin != header.origin)
      refuse(inputs.front(), input,
             "baked from different scenes or settings (" + header.fingerprint.hex() + ", " +
                 other.fingerprint.hex() + "): merge caches of one scene");
    for (const SurfaceRecord& record : input.contents.records) all.push_back({&record, &input});
  }
  merge_volumes(inputs, merged);
  CheckedRequests checked;
  for (const MergeInput& input : inputs)
    checked = united(checked, read_checks(input.contents.notes.checks));
  merged.notes.checks = checks_text(checked);
  merged.header = header;
  // Two versions of the program may make the same records; the later name stands for both.
  for (const MergeInput& input : inputs)
    merged.header.creator = std::max(merged.header.creator, input.contents.header.creator);
  merged.shards = union_of_shards(inputs);
  const bool is_whole = merged.shards.missing().empty();
  merged.header.shards = is_whole ? ShardSet() : merged.shards;

  std::sort(all.begin(), all.end(), [](const Held& a, const Held& b) {
    if (RecordOrder{}(*a.record, *b.record)) return true;
    if (RecordOrder{}(*b.record, *a.record)) return false;
    return a.record->flags < b.record->flags;  // Finished ones first.
  });
  merged.records.reserve(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i > 0 && !RecordOrder{}(*all[i - 1].record, *all[i].record)) {
      if (!is_same(*all[i - 1].record, *all[i].record)) refuse_conflict(all[i - 1], all[i]);
      ++merged.repeated;
      continue;
    }
    merged.records.push_back(*all[i].record);
  }
  if (is_whole && merged.shards.count > 0) mark_finished(merged.records);
  return merged;
}

}  // namespace brume
