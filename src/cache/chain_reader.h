// Reads a file's header and chain of blocks, in as many threads as pay. Private to cache/.
#pragma once

#include <unordered_map>

#include "cache/block_chain.h"

namespace brume {

struct ChainReading {
  CacheCheck check;
  ChainState state;
  std::unordered_map<std::uint64_t, std::vector<unsigned char>> notes;  // By key, if wanted.
};

struct ChainReadingOptions {
  std::optional<Fingerprint> expected{};
  bool stops_at_bad_records = false;
  bool keeps_notes = false;  // Else only those of CacheNotes.
};

// What `file`, of `bytes` bytes, holds up to the first thing wrong with it.
ChainReading read_chain(const PosixFile& file, std::uint64_t bytes,
                        const ChainReadingOptions& options = {});

}  // namespace brume
