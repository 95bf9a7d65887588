// The bytes of a cache file, little-endian, as docs/cache_format.md spells them out. Private to
// cache/.
//
//   file   = header block* [index footer]
//   header = 4096 bytes, readable with `head -c 4096`; ends with its own sum
//   block  = 64-byte block header, payload of `count` records of one kind, layer and wave
//   index  = 32 bytes for each block;  footer = 128 bytes, only in a complete file
//
// Surface records of a complete file are in RecordOrder, those of the medium and the solve's note between
// its deep and top ones. What speeds up opening (the order of the records
// along a curve) comes in blocks of its own kind that a reader may skip.
//
// A block names the sum of what precedes it (the file header's, then the previous block header's),
// so every byte up to the end of a valid chain is where and what it was written to be.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cache/cache_file.h"

namespace brume::cache_layout {

static_assert(std::endian::native == std::endian::little, "records are written as they lie in memory");

inline constexpr std::size_t kHeaderBytes = 4096, kBlockHeaderBytes = 64, kIndexEntryBytes = 32,
                             kFooterBytes = 128;
inline constexpr std::uint16_t kMajor = 1, kMinor = 2;
// Own offsets are kept in units of 64 bytes in 32 bits.
inline constexpr std::uint64_t kOffsetUnit = 64, kMaxFileBytes = kOffsetUnit << 32;

// What a block holds; the size of one stands in the header's table.
// Order: sixteen indices of surface records, 4 bytes each, along the curve that lookups sort by.
// Note: bytes that go with the record of the key that the block names, in units of kNoteUnitBytes; keys 0
// and 1 for what goes with all of them. The blocks of one note follow each other, the last ends its batch.
enum class RecordKind : std::uint8_t { Surface = 1, Volume = 2, Order = 3, Note = 4 };
inline constexpr std::uint32_t kNoteUnitBytes = 64;
inline constexpr std::uint64_t kKeyOfSolve = 0, kKeyOfChecks = 1;  // CacheNotes.
inline constexpr std::size_t kKinds = 4;
inline constexpr std::size_t kIndicesPerOrder = 16;
inline constexpr std::uint32_t kNoIndex = 0xffffffff;  // Fills the last entry of a layer.

// Block flags. A reader that does not know a block's kind skips it if it is optional, else refuses.
inline constexpr std::uint8_t kBatchEnds = 1;  // Last block of one seal().
inline constexpr std::uint8_t kOptional = 2;
inline constexpr std::uint8_t kAsGathered = 4;  // Not yet clamped by neighbours: only in a part.

struct BlockHeader {
  std::uint8_t kind = 0, layer = 0, wave = 0, flags = 0;
  std::uint32_t count = 0;       // Records in this block.
  std::uint32_t sequence = 0;    // Number of this block, from 0.
  std::uint64_t offset = 0;      // Of this block header in the file.
  std::uint32_t cumulative = 0;  // Records in the blocks before this one.
  std::uint64_t first_key = 0, last_key = 0;
  std::uint64_t previous = 0;  // Sum of the header before this one: of the file, then of blocks.
  std::uint64_t payload_sum = 0;
};

// Of a volume record on disk: padded with zeros.
std::size_t volume_record_file_bytes(int order);

using HeaderBytes = std::array<unsigned char, kHeaderBytes>;
using BlockHeaderBytes = std::array<unsigned char, kBlockHeaderBytes>;

// Throws Error(Internal) for settings or a creator that do not fit.
HeaderBytes encode_header(const CacheHeader& header);
BlockHeaderBytes encode_block_header(const BlockHeader& block);
// The sum at the end of an encoded header.
std::uint64_t header_sum(const HeaderBytes& bytes);
std::uint64_t block_header_sum(const BlockHeaderBytes& bytes);
// Index and footer of these blocks, for a file whose last block ends at `end`. A pure function of the
// chain, so a reader checks a footer by writing it again.
std::vector<unsigned char> encode_tail(const std::vector<BlockHeader>& blocks,
                                       const std::vector<std::uint64_t>& block_sums, std::uint64_t end);

// Header of a file of `size` >= kHeaderBytes; `state` is Loaded for a header that can be read on.
struct HeaderReading {
  CacheState state = CacheState::Loaded;
  std::string reason;
  CacheHeader header;
  std::array<std::uint32_t, kKinds> record_bytes{};  // By kind - 1; 0: no such kind.
};
// `bytes` holds the first min(size, kHeaderBytes) bytes of the file.
HeaderReading decode_header(const std::vector<unsigned char>& bytes);
// Nothing when the magic or the sum is not a block header's.
std::optional<BlockHeader> decode_block_header(const BlockHeaderBytes& bytes);

}  // namespace brume::cache_layout
