// Cache files: a header that describes itself, blocks of records chained by hashes, a footer when complete
// (docs/cache_format.md). Every byte is checked before it is believed; nothing is mapped.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cache/record.h"
#include "cache/volume_record.h"
#include "core/hash.h"
#include "core/math.h"

namespace brume {

// Which shards of one bake a cache that is no whole one holds.
struct ShardSet {
  static constexpr std::uint32_t kMaxShards = 4096;

  std::uint64_t request = 0;  // Hash of what the bake covers: shards of other requests do not fit.
  std::uint32_t count = 0;    // 0: a whole cache, or one that no shard made.
  std::vector<std::uint32_t> done;  // Ascending, each below `count`.

  bool is_valid() const;
  std::vector<std::uint32_t> missing() const;
  friend bool operator==(const ShardSet&, const ShardSet&) = default;
};

inline constexpr int kNoVolumeRecords = -1;  // As an order of moments.
// CacheHeader::volume_order of a file with these.
inline int volume_order_of(const VolumeRecords& records) {
  return records.size() > 0 ? records.order : kNoVolumeRecords;
}

struct CacheHeader {
  Fingerprint fingerprint;
  Vec3d origin{0.0};       // What record positions are relative to.
  std::string settings;    // Bake settings as one line of JSON, for people and `inspect`.
  std::string creator;     // Program and version; no clock, host or path.
  int format_minor = 0;    // Set by reading.
  int volume_order = kNoVolumeRecords;  // Up to which volume records keep moments.
  ShardSet shards{};

  // Longer ones are an Error(Internal) of CacheWriter; control characters too.
  static constexpr std::size_t kMaxSettingsBytes = 2536, kMaxCreatorBytes = 32;
};

inline constexpr int kCacheFormatVersion = 1;

// What a file says besides its records, outside fingerprint and settings. Each is one line of JSON, or empty.
struct CacheNotes {
  std::string solve;   // How the light of deep records was solved for (DeepStats).
  std::string checks;  // How true answers are (checks_text()).
  friend bool operator==(const CacheNotes&, const CacheNotes&) = default;
};

struct CacheContents {
  CacheHeader header;
  std::vector<SurfaceRecord> records;  // In file order.
  // Index in `records` of the end of each seal(), so that a copy can be cut into the same blocks.
  std::vector<std::size_t> batch_ends;
  VolumeRecords volume;  // Of the medium, in file order.
  CacheNotes notes;
  // All surface records along the lookups' curve, layer by layer; empty where the file tells none.
  std::vector<std::uint32_t> curve_order;
  std::size_t sealed_blocks = 0;
  bool is_complete = false;  // Has a valid footer.
};

// Corrupt: ours, and damaged or unfinished; Foreign: not ours, of another major version, or no regular
// file. Loaded is a complete file whose every byte and value was checked.
enum class CacheState { Loaded, Missing, Stale, Corrupt, Foreign };
struct CacheOpening {
  CacheState state = CacheState::Missing;
  std::string reason;      // One line without the file's name, for all but Loaded.
  CacheContents contents;  // When Corrupt, what precedes the damage: a part file's valid prefix.
};

// Never throws for what a file holds; throws Error(InvalidInput) for one that may not be opened and
// Error(Resource) when reading fails. `expected`: a different fingerprint is Stale. Allocates at most what
// the file's size allows. Never blocks on a FIFO or device.
CacheOpening open_cache(const std::filesystem::path& file, const std::optional<Fingerprint>& expected);

// What a file holds however damaged: the longest valid chain (for inspect --deep).
struct CacheCheck {
  CacheOpening opening;
  std::size_t bad_records = 0;  // Non-finite or out of range in otherwise valid blocks.
  std::uint64_t valid_bytes = 0, file_bytes = 0;
};
CacheCheck check_cache(const std::filesystem::path& file);

class CacheJournal;
class IrradianceCache;

// Writes FILE.next, then renames it to FILE, so that FILE is what it was or whole. A file is a pure
// function of what is passed in. Throws Error(Resource) naming path and bytes. The process must
// ignore SIGXFSZ to get that error for a file size limit.
class CacheWriter {
 public:
  // Takes the lock of FILE, which is the one on FILE.part, unless `journal`, that of FILE, holds it
  // already. Throws Error(Stopped) while another process, or another writer of this one, holds it.
  CacheWriter(const std::filesystem::path& file, const CacheHeader& header,
              const CacheJournal* journal = nullptr);
  // Without finish() nothing is left behind.
  ~CacheWriter();
  CacheWriter(CacheWriter&&) noexcept;
  CacheWriter& operator=(CacheWriter&&) noexcept;

  // `records` in RecordOrder, all of one layer and wave, none with a record_fault() (else
  // Error(Internal)). Cut into blocks of at most kBlockRecords.
  void seal(const std::vector<SurfaceRecord>& records);
  // Between deep surface records and top ones, so that a file cut short that holds any top record holds
  // all deep ones: those of the medium, in VolumeRecordOrder, of the header's volume_order, and
  // CacheNotes::solve.
  void seal_deep(const VolumeRecords& records, const std::string& solve);
  // CacheNotes::checks, after all records.
  void seal_checks(const std::string& checks);
  // IrradianceCache::curve_order(), after all records: with it a cache opens faster.
  void seal_order(int layer, std::span<const std::uint32_t> order);
  // Footer, fsync, rename, fsync of the folder.
  void finish();

  static constexpr std::size_t kBlockRecords = 8192;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// All of `cache` as FILE. Throws what CacheWriter throws.
void write_cache(const std::filesystem::path& file, CacheHeader header,
                 const IrradianceCache& cache, const CacheNotes& notes = {},
                 const CacheJournal* journal = nullptr);

}  // namespace brume
