// A cache file during one run: which of SPEC's states it is in, and what the mode makes of that.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bake/bake.h"
#include "cache/answer_check.h"
#include "cache/cache_journal.h"

namespace brume {

// "loaded", "missing", "stale", "corrupt", "foreign".
std::string cache_state_name(CacheState state);

// A cache that must be there and be ours, with the settings it was baked with.
struct OpenedCache {
  CacheHeader header;
  BakeSettings settings;
  IrradianceCache cache;
};

// Both kinds of records; takes them from `contents`.
IrradianceCache cache_of(CacheContents& contents);

// Settings as BakeSettings::to_json() wrote them. Throws Error(InvalidInput) naming `file` for
// others.
BakeSettings read_bake_settings(const std::string& json, const std::filesystem::path& file);

// For readers (verify, probe): whatever its settings, it must have been baked from this world.
// Throws Error(InvalidInput) with the reason.
OpenedCache open_cache_of_world(const std::filesystem::path& file, const World& world);

// Tells whether a file is still the one that was read.
struct FileIdentity {
  std::uint64_t device = 0, inode = 0, bytes = 0;
  std::int64_t modified_ns = 0;
  friend bool operator==(const FileIdentity&, const FileIdentity&) = default;
};

class CacheSession {
 public:
  // Without a file the session lives in memory alone. Throws Error(InvalidInput) for a file that is
  // stale, corrupt or foreign, unless the mode is New; for a missing one where the mode is Read.
  CacheSession(const CacheSettings& choice, const World& world, const BakeSettings& settings);

  bool has_file() const { return !file_.empty(); }
  const std::filesystem::path& file() const { return file_; }
  Fingerprint fingerprint() const { return fingerprint_; }
  bool may_bake() const { return mode_ != CacheMode::Read; }
  // Mode Missing fills gaps: with every place of `request` covered, or its shard done, and nothing
  // unfinished there is nothing to bake.
  bool needs_bake(const World& world, const BakeRequest& request) const;
  // What the file held and the mode keeps; null for nothing.
  std::shared_ptr<const IrradianceCache> existing() const { return existing_; }

  // What the file says of how true its answers to a request are (request_hash).
  std::optional<CheckedRequest> known_check(std::uint64_t request) const;

  // From here to save() nobody else writes the file, and `request` notes its gathers beside it.
  // Throws Error(Stopped) while somebody else does.
  void begin(const World& world, const JournalOptions& options, BakeRequest& request);
  // Writes what was baked, if a file was named and anything in it changes. Returns whether it did;
  // otherwise the file is untouched. A stopped bake also keeps its journal.
  // `checked`: how true its answers are, if that is known.
  bool save(const BakeResult& baked, const BakeRequest& request,
            const std::optional<CheckedRequest>& checked = std::nullopt);
  // What a bake has so far, while it goes on.
  void save_snapshot(const IrradianceCache& cache, const DeepStats& deep) const;
  // A file of this session, if not its cache then its journal, that the same command goes on from.
  std::optional<std::filesystem::path> checkpoint() const;

 private:
  void read();
  // Of this bake, or what the file said; checks of both.
  CacheNotes notes(const DeepStats& deep, const std::optional<CheckedRequest>& checked) const;
  CacheHeader header(const Vec3d& origin) const;

  std::filesystem::path file_;
  CacheMode mode_;
  BakeSettings settings_;
  Fingerprint fingerprint_;
  std::shared_ptr<const IrradianceCache> existing_;
  ShardSet shards_;    // Of the existing cache.
  CacheNotes notes_;   // Too.
  FileIdentity identity_;
  std::unique_ptr<CacheJournal> journal_;
  bool is_on_disk_ = false;  // A cache of ours is there under the name.
};

// Whether a cache, or the journal of one, lies there already: what a signal before any bake leaves.
bool has_checkpoint(const CacheSettings& choice);

// How many places find no record: pixel centres of the views, or points spread over all surfaces.
struct Coverage {
  std::size_t asked = 0, uncovered = 0;
};
Coverage measure_coverage(const World& world, const BakeSettings& settings,
                          const IrradianceCache& cache, const BakeRequest& request);

}  // namespace brume
