// Appends to a file header and blocks that name the sum of what precedes them. Private to cache/.
#pragma once

#include <chrono>
#include <span>
#include <vector>

#include "cache/cache_layout.h"
#include "cache/posix_file.h"

namespace brume {

// Where a chain stands.
struct ChainState {
  std::uint64_t end = 0;       // Where the valid prefix ends.
  std::uint64_t previous = 0;  // Sum of the last header in it.
  std::uint64_t units = 0;     // Records, of whatever kind, in its blocks.
  std::vector<cache_layout::BlockHeader> blocks;
  std::vector<std::uint64_t> block_sums;
};

class BlockChain {
 public:
  // Of an open file, from `state` on; a file without a header has none.
  explicit BlockChain(PosixFile file, ChainState state = {});

  void write_header(const CacheHeader& header);
  // `records` of one layer and wave, by key.
  void write_records(std::span<const SurfaceRecord> records, std::uint8_t flags);
  void write_records(const VolumeRecords& records);
  // Padded with zeros. With `flags` of its blocks.
  void write_note(std::uint64_t key, std::span<const unsigned char> note, std::uint8_t flags);
  void write_order(int layer, std::span<const std::uint32_t> order);
  void write_tail();
  // fdatasync after each block from now on; else now and then.
  void sync_each_block() { syncs_each_block_ = true; }
  void sync();
  void close() { file_.close(); }

  const PosixFile& file() const { return file_; }
  std::uint64_t end() const { return state_.end; }

 private:
  // Runs a step that touches the disk. After a failure what the disk holds is unknown (a failed
  // sync may drop pages and succeed the next time), so nothing further is tried but cutting the
  // file back.
  template <typename Step>
  void attempt(Step&& step);
  void append(const unsigned char* bytes, std::size_t count);
  void write_block(cache_layout::BlockHeader block, const void* payload, std::size_t payload_bytes);

  PosixFile file_;
  ChainState state_;
  bool has_failed_ = false, syncs_each_block_ = false;
  std::uint64_t unsynced_ = 0;
  std::chrono::steady_clock::time_point last_sync_ = std::chrono::steady_clock::now();
  std::vector<unsigned char> buffer_;
};

// Throws Error(Internal) unless the file could be read back: no record_fault(), one layer and wave,
// in order.
void check_batch(std::span<const SurfaceRecord> records, const std::filesystem::path& file);
void check_batch(const VolumeRecords& records, const std::filesystem::path& file);

// Of `file`, durably; some file systems have no such thing for folders and say EINVAL.
void sync_folder_of(const std::filesystem::path& file);

}  // namespace brume
