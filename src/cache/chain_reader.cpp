#include "cache/chain_reader.h"

#include <algorithm>
#include <cstring>

#include "cache/large_pages.h"
#include "core/error.h"
#include "core/parallel.h"

namespace brume {
namespace {

using namespace cache_layout;

// Blocks that are read at once: memory grows by 64 MiB before what was read before is known to be
// sound.
constexpr std::size_t kBlocksAtOnce = 64;
// Fewer are not worth a thread.
constexpr std::size_t kBlocksPerThread = 4;

class Reader {
 public:
  Reader(const PosixFile& file, std::uint64_t size) : file_(file), size_(size) {}

  ChainReading read(const ChainReadingOptions& options) {
    keeps_notes_ = options.keeps_notes;
    check_.file_bytes = size_;
    std::vector<unsigned char> bytes(std::min<std::uint64_t>(size_, kHeaderBytes));
    if (!fetch(bytes.data(), bytes.size(), 0)) return corrupt(kShrank);
    header_ = decode_header(bytes);
    if (header_.state != CacheState::Loaded) return refuse(header_.state, header_.reason);
    contents().header = header_.header;
    state_.end = check_.valid_bytes = kHeaderBytes;
    const auto& expected = options.expected;
    if (expected && *expected != header_.header.fingerprint)
      return refuse(CacheState::Stale, "made for other inputs or settings: its fingerprint is " +
                                           header_.header.fingerprint.hex() + ", not " +
                                           expected->hex());
    HeaderBytes whole;
    std::copy(bytes.begin(), bytes.end(), whole.begin());
    state_.previous = header_sum(whole);

    for (bool goes_on = true; goes_on;) {
      std::string wrong;
      const std::vector<Block> batch = next_blocks(wrong);
      goes_on = batch.size() == kBlocksAtOnce;
      const std::string wrong_before = take(batch);
      if (!wrong_before.empty()) return corrupt(wrong_before);
      if (!wrong.empty()) return corrupt(wrong);
      if (options.stops_at_bad_records && check_.bad_records > 0) return corrupt(first_fault_);
    }
    const std::string wrong = read_tail();
    if (!wrong.empty()) return corrupt(wrong);
    if (check_.bad_records > 0) return corrupt(first_fault_);
    check_.opening.state = CacheState::Loaded;
    return {std::move(check_), std::move(state_), std::move(notes_)};
  }

 private:
  static constexpr const char* kShrank = "the file shrank while it was read";
  static constexpr const char* kNotThose = "its records are not those its header tells of";

  // A block whose header fits where it lies.
  struct Block {
    BlockHeader header;
    std::uint64_t sum = 0;  // Of the header.
    std::uint64_t payload_bytes = 0;
    std::uint64_t end() const { return header.offset + kBlockHeaderBytes + payload_bytes; }
  };
  // What one block's records turned out to be.
  struct Finding {
    const char* wrong = nullptr;  // Nothing of the block is to be believed.
    std::size_t bad_records = 0, first_bad = 0;
    const char* fault = nullptr;  // Of the first bad one.
  };

  CacheContents& contents() { return check_.opening.contents; }
  ChainReading refuse(CacheState state, const std::string& reason) {
    check_.opening.state = state;
    check_.opening.reason = reason;
    contents().curve_order.clear();  // Of no use for a part.
    return {std::move(check_), std::move(state_), std::move(notes_)};
  }
  ChainReading corrupt(const std::string& reason) { return refuse(CacheState::Corrupt, reason); }

  // False where the file turned out shorter than it was.
  bool fetch(void* bytes, std::size_t count, std::uint64_t offset) const {
    return file_.read(static_cast<unsigned char*>(bytes), count, offset) == count;
  }

  static bool is(const Block& block, RecordKind kind) {
    return block.header.kind == static_cast<std::uint8_t>(kind);
  }
  // Of a layout that is known.
  bool is_volume(const Block& block) const {
    return is(block, RecordKind::Volume) && header_.header.volume_order != kNoVolumeRecords;
  }

  // The next blocks by their headers alone; `wrong` says why there are no more, unless what follows
  // is no block at all.
  std::vector<Block> next_blocks(std::string& wrong) {
    std::vector<Block> batch;
    std::uint64_t end = state_.end, previous = state_.previous, units = state_.units;
    while (batch.size() < kBlocksAtOnce) {
      const std::size_t sequence = state_.blocks.size() + batch.size();
      const auto stop = [&](const std::string& what) {
        wrong = at(sequence, end, what);
        return batch;
      };
      const std::uint64_t left = size_ - end;
      if (left < kBlockHeaderBytes) return batch;
      BlockHeaderBytes bytes;
      if (!fetch(bytes.data(), bytes.size(), end)) return stop(kShrank);
      const std::optional<BlockHeader> decoded = decode_block_header(bytes);
      if (!decoded) return batch;
      const BlockHeader& block = *decoded;
      if (block.offset != end || block.sequence != sequence || block.previous != previous ||
          block.cumulative != units)
        return stop("not the block that was written here");
      if (block.count == 0 || block.count > CacheWriter::kBlockRecords)
        return stop("says it holds " + std::to_string(block.count) + " records");
      const std::uint32_t record_bytes =
          block.kind >= 1 && block.kind <= kKinds ? header_.record_bytes[block.kind - 1u] : 0;
      if (record_bytes == 0)
        return stop("holds records of unknown kind " + std::to_string(block.kind));
      const std::uint64_t payload_bytes = std::uint64_t(block.count) * record_bytes;
      if (payload_bytes > left - kBlockHeaderBytes) return stop("the file ends in it");
      batch.push_back({block, block_header_sum(bytes), payload_bytes});
      const bool is_known = is(batch.back(), RecordKind::Surface) || is_volume(batch.back());
      if (!is_known && (block.flags & kOptional) == 0) {
        batch.pop_back();
        return stop("holds records that need a newer brume");
      }
      end = batch.back().end();
      previous = batch.back().sum;
      units += block.count;
    }
    return batch;
  }

  static std::string at(std::size_t sequence, std::uint64_t offset, const std::string& what) {
    return "block " + std::to_string(sequence) + " at byte " + std::to_string(offset) + ": " + what;
  }

  // Reads and checks what the blocks hold, up to the first that is wrong; says what is.
  std::string take(const std::vector<Block>& batch) {
    std::vector<SurfaceRecord>& records = contents().records;
    if (records.empty()) {
      // As many as the file can hold, so that a large cache is not copied while it grows; bounded,
      // as a sparse file's size costs its writer nothing.
      constexpr std::uint64_t kMostReserved = std::uint64_t(1) << 20;
      reserve_in_large_pages(
          records, std::min((size_ - kHeaderBytes) / sizeof(SurfaceRecord), kMostReserved));
    }
    std::vector<std::size_t> place(batch.size());
    std::size_t count = records.size();
    for (std::size_t i = 0; i < batch.size(); ++i) {
      place[i] = count;
      if (is(batch[i], RecordKind::Surface)) count += batch[i].header.count;
    }
    records.resize(count);
    std::vector<Finding> findings(batch.size());
    std::vector<std::vector<std::uint32_t>> orders(batch.size());
    std::vector<std::vector<unsigned char>> others(batch.size());
    parallel_for(batch.size() > kBlocksPerThread ? 0 : 1, batch.size(), kBlocksPerThread,
                 [&](std::size_t i) {
                   findings[i] = is(batch[i], RecordKind::Surface)
                                     ? read_records(batch[i], &records[place[i]], place[i])
                                     : read_other(batch[i], orders[i], others[i]);
                 });
    for (std::size_t i = 0; i < batch.size(); ++i) {
      Finding& found = findings[i];
      if (!found.wrong && is_volume(batch[i])) found = add_volume_records(batch[i], others[i]);
      if (found.wrong) {
        records.resize(place[i]);
        return at(state_.blocks.size(), state_.end, found.wrong);
      }
      if (found.fault && check_.bad_records == 0)
        first_fault_ = (is_volume(batch[i]) ? "volume record " : "record ") +
                       std::to_string(found.first_bad) + ": " + found.fault;
      if (is(batch[i], RecordKind::Note)) add_to_note(batch[i], others[i]);
      check_.bad_records += found.bad_records;
      has_raw_ |= (batch[i].header.flags & kAsGathered) != 0;
      if (is(batch[i], RecordKind::Surface) && (batch[i].header.flags & kBatchEnds) != 0)
        contents().batch_ends.push_back(place[i] + batch[i].header.count);
      for (const std::uint32_t index : orders[i])
        if (index != kNoIndex) contents().curve_order.push_back(index);
      state_.previous = batch[i].sum;
      state_.units += batch[i].header.count;
      state_.blocks.push_back(batch[i].header);
      state_.block_sums.push_back(batch[i].sum);
      state_.end = check_.valid_bytes = batch[i].end();
      contents().sealed_blocks = state_.blocks.size();
    }
    return "";
  }

  const char* fetch_payload(const Block& block, void* bytes) const {
    if (!fetch(bytes, block.payload_bytes, block.header.offset + kBlockHeaderBytes)) return kShrank;
    if (hash64(bytes, block.payload_bytes) != block.header.payload_sum)
      return "the checksum of its records does not match";
    return nullptr;
  }

  // Sums are no signature: what a valid sum covers is checked all the same.
  Finding read_records(const Block& block, SurfaceRecord* records, std::size_t place) const {
    Finding found;
    found.wrong = fetch_payload(block, records);
    if (found.wrong) return found;
    const BlockHeader& header = block.header;
    std::uint64_t last_key = header.first_key;
    bool is_ordered =
        records[0].key == header.first_key && records[header.count - 1].key == header.last_key;
    for (std::size_t i = 0; i < header.count; ++i) {
      const SurfaceRecord& record = records[i];
      is_ordered &=
          record.layer() == header.layer && record.wave() == header.wave && record.key >= last_key;
      last_key = record.key;
      if (const char* fault = record_fault(record)) {
        if (found.bad_records++ == 0) {
          found.first_bad = place + i;
          found.fault = fault;
        }
      }
    }
    if (!is_ordered) found.wrong = kNotThose;
    return found;
  }

  // A part's are in no order from block to block, as a file's are.
  Finding add_volume_records(const Block& block, const std::vector<unsigned char>& bytes) {
    Finding found;
    VolumeRecords& all = contents().volume;
    all.order = header_.header.volume_order;
    const std::size_t first = all.size();
    const BlockHeader& header = block.header;
    std::vector<VolumeMoment> moments(all.stride());
    std::uint64_t last_key = header.first_key;
    bool is_ordered = true;
    for (std::size_t i = 0; i < header.count; ++i) {
      const unsigned char* at = bytes.data() + i * header_.record_bytes[block.header.kind - 1u];
      VolumeRecord record;
      std::memcpy(&record, at, sizeof record);
      std::memcpy(moments.data(), at + sizeof record, moments.size() * sizeof(VolumeMoment));
      is_ordered &=
          record.layer() == header.layer && record.wave() == header.wave && record.key >= last_key;
      last_key = record.key;
      if (const char* fault = record_fault(record, moments)) {
        if (found.bad_records++ == 0) {
          found.first_bad = all.size();
          found.fault = fault;
        }
      }
      all.push_back(record, moments);
    }
    if (!is_ordered || all.records[first].key != header.first_key || last_key != header.last_key) {
      found.wrong = kNotThose;
      all.records.resize(first);
      all.moments.resize(first * all.stride());
    }
    return found;
  }

  Finding read_other(const Block& block, std::vector<std::uint32_t>& order,
                     std::vector<unsigned char>& kept) const {
    std::vector<unsigned char> payload(block.payload_bytes);
    Finding found;
    found.wrong = fetch_payload(block, payload.data());
    if (!found.wrong && (is_volume(block) || (is(block, RecordKind::Note) && keeps_note(block)))) {
      kept = std::move(payload);
      return found;
    }
    if (found.wrong || !is(block, RecordKind::Order) ||
        header_.record_bytes[block.header.kind - 1u] != kIndicesPerOrder * sizeof(std::uint32_t))
      return found;
    order.resize(payload.size() / sizeof(std::uint32_t));
    std::memcpy(order.data(), payload.data(), payload.size());
    return found;
  }

  bool keeps_note(const Block& block) const {
    return keeps_notes_ || block.header.first_key == kKeyOfSolve ||
           block.header.first_key == kKeyOfChecks;
  }

  // A note that is not followed to its end is none.
  void add_to_note(const Block& block, const std::vector<unsigned char>& bytes) {
    if (!keeps_note(block)) return;
    if (note_key_ != block.header.first_key) note_.clear();
    note_key_ = block.header.first_key;
    note_.insert(note_.end(), bytes.begin(), bytes.end());
    if ((block.header.flags & kBatchEnds) == 0) return;
    const std::string text(note_.begin(), std::find(note_.begin(), note_.end(), 0));
    if (note_key_ == kKeyOfSolve)
      contents().notes.solve = text;
    else if (note_key_ == kKeyOfChecks && !keeps_notes_)
      contents().notes.checks = text;
    else
      notes_.insert_or_assign(note_key_, std::move(note_));
    note_.clear();
  }

  // Each record once, layer by layer, so that whatever the order, every record is found.
  bool is_order_sound() {
    const std::vector<std::uint32_t>& order = contents().curve_order;
    const std::vector<SurfaceRecord>& records = contents().records;
    if (order.empty()) return true;
    if (order.size() != records.size()) return false;
    std::vector<std::uint64_t> seen((records.size() + 63) / 64);
    for (std::size_t begin = 0; begin < records.size();) {
      const auto end = static_cast<std::size_t>(
          std::partition_point(records.begin() + static_cast<std::ptrdiff_t>(begin), records.end(),
                               [layer = records[begin].layer()](const SurfaceRecord& r) {
                                 return r.layer() <= layer;
                               }) -
          records.begin());
      for (std::size_t i = begin; i < end; ++i) {
        if (order[i] < begin || order[i] >= end) return false;
        std::uint64_t& word = seen[order[i] / 64];
        const std::uint64_t bit = std::uint64_t(1) << order[i] % 64;
        if (word & bit) return false;
        word |= bit;
      }
      begin = std::max(end, begin + 1);
    }
    return true;
  }

  // Empty for a complete file.
  std::string read_tail() {
    const std::uint64_t left = size_ - state_.end;
    const std::string held = "; " + std::to_string(contents().records.size()) + " records in " +
                             std::to_string(state_.blocks.size()) + " blocks precede it";
    if (left == 0) return "unfinished: no footer" + held;
    const std::vector<unsigned char> tail =
        encode_tail(state_.blocks, state_.block_sums, state_.end);
    std::vector<unsigned char> present(std::min<std::uint64_t>(left, tail.size()));
    if (!fetch(present.data(), present.size(), state_.end)) return kShrank;
    if (!std::equal(present.begin(), present.end(), tail.begin()))
      return at(state_.blocks.size(), state_.end, "damaged, cut off or no block" + held);
    if (left < tail.size()) return "the file ends in its footer" + held;
    if (left > tail.size())
      return std::to_string(left - tail.size()) +
             " bytes that do not belong to it follow the footer";
    if (has_raw_) return "its records are as they were gathered, not as a bake leaves them";
    if (!is_order_sound()) return "its lookup order is none of its records";
    check_.valid_bytes = size_;
    contents().is_complete = true;
    return "";
  }

  const PosixFile& file_;
  std::uint64_t size_;
  HeaderReading header_;
  CacheCheck check_;
  ChainState state_;
  bool has_raw_ = false, keeps_notes_ = false;
  std::unordered_map<std::uint64_t, std::vector<unsigned char>> notes_;
  std::uint64_t note_key_ = 0;
  std::vector<unsigned char> note_;
  std::string first_fault_;
};

}  // namespace

ChainReading read_chain(const PosixFile& file, std::uint64_t bytes,
                        const ChainReadingOptions& options) {
  return Reader(file, bytes).read(options);
}

}  // namespace brume
