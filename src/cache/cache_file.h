// Cache files: a header that describes itself, blocks of records chained by hashes, a footer when complete
// (docs/cache_format.md). Every byte is checked before it is believed; nothing is mapped.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cache/record.h"
#include "core/hash.h"
#include "core/math.h"

namespace brume {

struct CacheHeader {
  Fingerprint fingerprint;
  Vec3d origin{0.0};       // What record positions are relative to.
  std::string settings;    // Bake settings as one line of JSON, for people and `inspect`.
  std::string creator;     // Program and version; no clock, host or path.
};

struct CacheContents {
  CacheHeader header;
  std::vector<SurfaceRecord> records;  // In file order.
  std::size_t sealed_blocks = 0;
  bool is_complete = false;  // Has a valid footer.
};

enum class CacheState { Loaded, Missing, Stale, Corrupt, Foreign };
struct CacheOpening {
  CacheState state = CacheState::Missing;
  std::string reason;  // One line, for all but Loaded.
  CacheContents contents;
};

// Never throws for what a file holds. `expected`: a different fingerprint is Stale. Allocates at most what
// the file's size allows.
CacheOpening open_cache(const std::filesystem::path& file, const std::optional<Fingerprint>& expected);

// What a file holds however damaged: the longest valid chain (for inspect --deep).
struct CacheCheck {
  CacheOpening opening;
  std::size_t bad_records = 0;  // Non-finite or out of range in otherwise valid blocks.
  std::uint64_t valid_bytes = 0, file_bytes = 0;
};
CacheCheck check_cache(const std::filesystem::path& file);

// Writes FILE.part, block by block, then renames it to FILE. A file is a pure function of what is passed
// in. Throws Error(Resource) naming path and bytes; the part is then a valid prefix.
class CacheWriter {
 public:
  CacheWriter(const std::filesystem::path& file, const CacheHeader& header);
  ~CacheWriter();  // Without finish() the part is removed.

  // Once it returns, the records survive a killed process; `records` in RecordOrder, all of one layer and
  // wave. Cut into blocks of at most kBlockRecords.
  void seal(const std::vector<SurfaceRecord>& records);
  // Footer, fsync, rename, fsync of the folder.
  void finish();

  static constexpr std::size_t kBlockRecords = 8192;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace brume
