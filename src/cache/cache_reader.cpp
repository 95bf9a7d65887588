#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "cache/cache_file.h"
#include "cache/cache_layout.h"
#include "cache/posix_file.h"
#include "core/error.h"

namespace brume {
namespace {

using namespace cache_layout;

class Reader {
 public:
  Reader(const PosixFile& file, std::uint64_t size) : file_(file), size_(size) {}

  // Reads what the file holds up to the first thing wrong with it.
  CacheCheck read(const std::optional<Fingerprint>& expected, bool stop_at_bad_records) {
    check_.file_bytes = size_;
    std::vector<unsigned char> bytes(std::min<std::uint64_t>(size_, kHeaderBytes));
    if (!fetch(bytes.data(), bytes.size(), 0)) return corrupt("the file shrank while it was read");
    const HeaderReading reading = decode_header(bytes);
    if (reading.state != CacheState::Loaded) return refuse(reading.state, reading.reason);
    contents().header = reading.header;
    check_.valid_bytes = kHeaderBytes;
    if (expected && *expected != reading.header.fingerprint)
      return refuse(CacheState::Stale, "made for other inputs or settings: its fingerprint is " +
                                           reading.header.fingerprint.hex() + ", not " +
                                           expected->hex());
    std::copy(bytes.begin(), bytes.end(), header_.begin());
    previous_ = header_sum(header_);

    for (;;) {
      const std::string wrong = read_block(reading);
      if (wrong == kNoBlock) break;
      if (!wrong.empty()) return corrupt(wrong);
      if (stop_at_bad_records && check_.bad_records > 0) return corrupt(first_fault_);
    }
    const std::string wrong = read_tail();
    if (!wrong.empty()) return corrupt(wrong);
    if (check_.bad_records > 0) return corrupt(first_fault_);
    check_.opening.state = CacheState::Loaded;
    return std::move(check_);
  }

 private:
  static constexpr const char* kNoBlock = "no block";

  CacheContents& contents() { return check_.opening.contents; }
  CacheCheck refuse(CacheState state, const std::string& reason) {
    check_.opening.state = state;
    check_.opening.reason = reason;
    return std::move(check_);
  }
  CacheCheck corrupt(const std::string& reason) { return refuse(CacheState::Corrupt, reason); }

  // False where the file turned out shorter than it was.
  bool fetch(unsigned char* bytes, std::size_t count, std::uint64_t offset) {
    return file_.read(bytes, count, offset) == count;
  }

  std::string at(const std::string& what) const {
    return "block " + std::to_string(blocks_.size()) + " at byte " +
           std::to_string(check_.valid_bytes) + ": " + what;
  }

  // Empty for a valid block, kNoBlock where something else than a block begins, else what is wrong.
  std::string read_block(const HeaderReading& reading) {
    const std::uint64_t offset = check_.valid_bytes, left = size_ - offset;
    if (left < kBlockHeaderBytes) return kNoBlock;
    BlockHeaderBytes bytes;
    if (!fetch(bytes.data(), bytes.size(), offset)) return at("the file shrank while it was read");
    const std::optional<BlockHeader> decoded = decode_block_header(bytes);
    if (!decoded) return kNoBlock;
    const BlockHeader& block = *decoded;
    if (block.offset != offset || block.sequence != blocks_.size() || block.previous != previous_ ||
        block.cumulative != cumulative_)
      return at("not the block that was written here");
    if (block.count == 0 || block.count > CacheWriter::kBlockRecords)
      return at("says it holds " + std::to_string(block.count) + " records");
    const std::uint32_t record_bytes =
        block.kind >= 1 && block.kind <= kKinds ? reading.record_bytes[block.kind - 1u] : 0;
    if (record_bytes == 0) return at("holds records of unknown kind " + std::to_string(block.kind));
    const std::uint64_t payload_bytes = std::uint64_t(block.count) * record_bytes;
    if (payload_bytes > left - kBlockHeaderBytes) return at("the file ends in it");
    const bool is_known = block.kind == static_cast<std::uint8_t>(RecordKind::Surface);
    if (!is_known && (block.flags & kOptional) == 0)
      return at("holds records that need a newer brume");
    payload_.resize(payload_bytes);
    if (!fetch(payload_.data(), payload_.size(), offset + kBlockHeaderBytes))
      return at("the file shrank while it was read");
    if (hash64(payload_.data(), payload_.size()) != block.payload_sum)
      return at("the checksum of its records does not match");
    if (is_known) {
      const std::string wrong = take_records(block);
      if (!wrong.empty()) return wrong;
      if ((block.flags & kBatchEnds) != 0)
        contents().batch_ends.push_back(contents().records.size());
    }
    previous_ = block_header_sum(bytes);
    cumulative_ += block.count;
    blocks_.push_back(block);
    block_sums_.push_back(previous_);
    check_.valid_bytes = offset + kBlockHeaderBytes + payload_bytes;
    contents().sealed_blocks = blocks_.size();
    return "";
  }

  // Sums are no signature: what a valid sum covers is checked all the same.
  std::string take_records(const BlockHeader& block) {
    std::vector<SurfaceRecord>& records = contents().records;
    const std::size_t first = records.size();
    if (first == 0) {
      // As many as the file can hold, so that a large cache is not copied while it grows; bounded, as a
      // sparse file's size costs its writer nothing.
      constexpr std::uint64_t kMostReserved = std::uint64_t(1) << 20;
      records.reserve(std::min((size_ - kHeaderBytes) / sizeof(SurfaceRecord), kMostReserved));
    }
    std::uint64_t last_key = block.first_key;
    records.resize(first + block.count);
    std::memcpy(static_cast<void*>(records.data() + first), payload_.data(), payload_.size());
    const SurfaceRecord* const end = records.data() + records.size();
    bool is_ordered = records[first].key == block.first_key && records.back().key == block.last_key;
    for (const SurfaceRecord* record = records.data() + first; record != end; ++record) {
      is_ordered &= record->layer() == block.layer && record->wave() == block.wave &&
                    record->key >= last_key;
      last_key = record->key;
      if (const char* fault = record_fault(*record)) {
        if (check_.bad_records++ == 0)
          first_fault_ = "record " + std::to_string(record - records.data()) + ": " + fault;
      }
    }
    if (is_ordered) return "";
    records.resize(first);
    return at("its records are not those its header tells of");
  }

  // Empty for a complete file.
  std::string read_tail() {
    const std::uint64_t left = size_ - check_.valid_bytes;
    const std::string held = "; " + std::to_string(contents().records.size()) + " records in " +
                             std::to_string(blocks_.size()) + " blocks precede it";
    if (left == 0) return "unfinished: no footer" + held;
    const std::vector<unsigned char> tail = encode_tail(blocks_, block_sums_, check_.valid_bytes);
    std::vector<unsigned char> present(std::min<std::uint64_t>(left, tail.size()));
    if (!fetch(present.data(), present.size(), check_.valid_bytes))
      return at("the file shrank while it was read");
    if (!std::equal(present.begin(), present.end(), tail.begin()))
      return at("damaged, cut off or no block" + held);
    if (left < tail.size()) return "the file ends in its footer" + held;
    if (left > tail.size())
      return std::to_string(left - tail.size()) + " bytes that do not belong to it follow the footer";
    check_.valid_bytes = size_;
    contents().is_complete = true;
    return "";
  }

  const PosixFile& file_;
  std::uint64_t size_;
  CacheCheck check_;
  HeaderBytes header_{};
  std::uint64_t previous_ = 0;
  std::uint32_t cumulative_ = 0;
  std::vector<BlockHeader> blocks_;
  std::vector<std::uint64_t> block_sums_;
  std::vector<unsigned char> payload_;
  std::string first_fault_;
};

CacheCheck examine(const std::filesystem::path& file, const std::optional<Fingerprint>& expected,
                   bool stop_at_bad_records) {
  CacheCheck nothing;
  // Without O_NONBLOCK, opening a FIFO waits for its writer.
  const PosixFile opened(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY), file);
  if (!opened.is_open()) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) {
      nothing.opening.reason = "no such file";
      return nothing;
    }
    if (error == ENXIO || error == ENODEV) {  // A socket, or a device without a driver.
      nothing.opening.state = CacheState::Foreign;
      nothing.opening.reason = "not a regular file";
      return nothing;
    }
    throw Error(ErrorKind::InvalidInput,
                file.string() + ": cannot be opened: " + std::strerror(error));
  }
  const struct stat status = opened.status();
  if (!S_ISREG(status.st_mode)) {
    nothing.opening.state = CacheState::Foreign;
    nothing.opening.reason = S_ISDIR(status.st_mode) ? "a folder, not a file" : "not a regular file";
    return nothing;
  }
  return Reader(opened, static_cast<std::uint64_t>(status.st_size)).read(expected, stop_at_bad_records);
}

}  // namespace

CacheOpening open_cache(const std::filesystem::path& file, const std::optional<Fingerprint>& expected) {
  return examine(file, expected, true).opening;
}

CacheCheck check_cache(const std::filesystem::path& file) { return examine(file, std::nullopt, false); }

}  // namespace brume
