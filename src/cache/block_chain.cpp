#include "cache/block_chain.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "core/error.h"

namespace brume {
namespace {

using namespace cache_layout;
using Clock = std::chrono::steady_clock;

// How much a power loss may cost; nothing of it reaches the bytes.
constexpr std::uint64_t kSyncBytes = std::uint64_t(16) << 20;
constexpr std::chrono::seconds kSyncInterval{10};

}  // namespace

BlockChain::BlockChain(PosixFile file, ChainState state)
    : file_(std::move(file)), state_(std::move(state)) {}

template <typename Step>
void BlockChain::attempt(Step&& step) {
  const std::string path = file_.path().string();
  if (!file_.is_open()) throw Error(ErrorKind::Internal, path + ": written to after its end");
  if (has_failed_) throw Error(ErrorKind::Resource, path + ": not written: writing failed before");
  try {
    step();
  } catch (const Error&) {
    has_failed_ = true;
    // Best effort: a torn block does no harm, readers find where the chain ends.
    [[maybe_unused]] const int ignored =
        ::ftruncate(file_.descriptor(), static_cast<off_t>(state_.end));
    throw;
  }
}

void BlockChain::append(const unsigned char* bytes, std::size_t count) {
  file_.write(bytes, count, state_.end);
  state_.end += count;
  unsynced_ += count;
}

void BlockChain::write_header(const CacheHeader& header) {
  const HeaderBytes bytes = encode_header(header);
  attempt([&] { append(bytes.data(), bytes.size()); });
  state_.previous = header_sum(bytes);
}

void BlockChain::write_block(BlockHeader block, const void* payload, std::size_t payload_bytes) {
  attempt([&] {
    if (state_.end + kBlockHeaderBytes + payload_bytes > kMaxFileBytes)
      throw Error(ErrorKind::Resource,
                  file_.path().string() + ": cannot write " + std::to_string(payload_bytes) +
                      " bytes at " + std::to_string(state_.end) + ": over the format's 256 GiB");
    block.sequence = static_cast<std::uint32_t>(state_.blocks.size());
    block.offset = state_.end;
    block.cumulative = static_cast<std::uint32_t>(state_.units);
    block.previous = state_.previous;
    block.payload_sum = hash64(payload, payload_bytes);
    const BlockHeaderBytes header = encode_block_header(block);
    buffer_.resize(kBlockHeaderBytes + payload_bytes);
    std::copy(header.begin(), header.end(), buffer_.begin());
    std::memcpy(buffer_.data() + kBlockHeaderBytes, payload, payload_bytes);
    append(buffer_.data(), buffer_.size());
    state_.previous = block_header_sum(header);
    state_.units += block.count;
    state_.blocks.push_back(block);
    state_.block_sums.push_back(state_.previous);
    if (syncs_each_block_ || unsynced_ >= kSyncBytes ||
        Clock::now() - last_sync_ >= kSyncInterval) {
      file_.sync_data();
      unsynced_ = 0;
      last_sync_ = Clock::now();
    }
  });
}

void BlockChain::write_records(std::span<const SurfaceRecord> records, std::uint8_t flags) {
  for (std::size_t i = 0; i < records.size(); i += CacheWriter::kBlockRecords) {
    const auto part = records.subspan(i, std::min(CacheWriter::kBlockRecords, records.size() - i));
    BlockHeader block;
    block.kind = static_cast<std::uint8_t>(RecordKind::Surface);
    block.layer = static_cast<std::uint8_t>(part.front().layer());
    block.wave = static_cast<std::uint8_t>(part.front().wave());
    block.flags = flags;
    if (i + part.size() == records.size()) block.flags |= kBatchEnds;
    block.count = static_cast<std::uint32_t>(part.size());
    block.first_key = part.front().key;
    block.last_key = part.back().key;
    write_block(block, part.data(), part.size_bytes());
  }
}

void BlockChain::write_records(const VolumeRecords& all) {
  const std::size_t stride = volume_record_file_bytes(all.order),
                    moment_bytes = all.stride() * sizeof(VolumeMoment);
  std::vector<unsigned char> payload;
  for (std::size_t begin = 0; begin < all.size();) {
    const VolumeRecord& first = all.records[begin];
    const auto goes_on = [&](std::size_t i) {
      return i < all.size() && all.records[i].layer() == first.layer() &&
             all.records[i].wave() == first.wave();
    };
    std::size_t end = begin;
    while (end - begin < CacheWriter::kBlockRecords && goes_on(end)) ++end;
    payload.assign((end - begin) * stride, 0);
    for (std::size_t i = begin; i < end; ++i) {
      unsigned char* bytes = payload.data() + (i - begin) * stride;
      std::memcpy(bytes, &all.records[i], sizeof(VolumeRecord));
      std::memcpy(bytes + sizeof(VolumeRecord), all.moments_of(i).data(), moment_bytes);
    }
    BlockHeader block;
    block.kind = static_cast<std::uint8_t>(RecordKind::Volume);
    block.layer = static_cast<std::uint8_t>(first.layer());
    block.wave = static_cast<std::uint8_t>(first.wave());
    if (!goes_on(end)) block.flags |= kBatchEnds;
    block.count = static_cast<std::uint32_t>(end - begin);
    block.first_key = first.key;
    block.last_key = all.records[end - 1].key;
    write_block(block, payload.data(), payload.size());
    begin = end;
  }
}

void BlockChain::write_note(std::uint64_t key, std::span<const unsigned char> note,
                            std::uint8_t flags) {
  std::vector<unsigned char> padded(note.begin(), note.end());
  padded.resize((note.size() + kNoteUnitBytes - 1) / kNoteUnitBytes * kNoteUnitBytes);
  constexpr std::size_t kMostBytes = CacheWriter::kBlockRecords * kNoteUnitBytes;
  for (std::size_t i = 0; i < padded.size(); i += kMostBytes) {
    const std::size_t count = std::min(kMostBytes, padded.size() - i);
    BlockHeader block;
    block.kind = static_cast<std::uint8_t>(RecordKind::Note);
    block.flags = flags | kOptional;
    if (i + count == padded.size()) block.flags |= kBatchEnds;
    block.count = static_cast<std::uint32_t>(count / kNoteUnitBytes);
    block.first_key = block.last_key = key;
    write_block(block, padded.data() + i, count);
  }
}

void BlockChain::write_order(int layer, std::span<const std::uint32_t> order) {
  std::vector<std::uint32_t> padded(order.begin(), order.end());
  padded.resize((order.size() + kIndicesPerOrder - 1) / kIndicesPerOrder * kIndicesPerOrder,
                kNoIndex);
  constexpr std::size_t kBlockIndices = CacheWriter::kBlockRecords * kIndicesPerOrder;
  for (std::size_t i = 0; i < padded.size(); i += kBlockIndices) {
    const std::size_t count = std::min(kBlockIndices, padded.size() - i);
    BlockHeader block;
    block.kind = static_cast<std::uint8_t>(RecordKind::Order);
    block.layer = static_cast<std::uint8_t>(layer);
    block.flags = kOptional;
    if (i + count == padded.size()) block.flags |= kBatchEnds;
    block.count = static_cast<std::uint32_t>(count / kIndicesPerOrder);
    write_block(block, padded.data() + i, count * sizeof(std::uint32_t));
  }
}

void BlockChain::write_tail() {
  attempt([&] {
    const std::vector<unsigned char> tail =
        encode_tail(state_.blocks, state_.block_sums, state_.end);
    file_.write(tail.data(), tail.size(), state_.end);
    file_.sync();
  });
}

void BlockChain::sync() {
  attempt([&] { file_.sync(); });
}

void check_batch(std::span<const SurfaceRecord> records, const std::filesystem::path& file) {
  for (std::size_t i = 0; i < records.size(); ++i) {
    const char* wrong = record_fault(records[i]);
    if (!wrong && (records[i].flags & 0xffff) != (records[0].flags & 0xffff))
      wrong = "another layer or wave than the first";
    if (!wrong && i > 0 && RecordOrder{}(records[i], records[i - 1])) wrong = "out of order";
    if (wrong)
      throw Error(ErrorKind::Internal,
                  file.string() + ": record " + std::to_string(i) + " of a batch: " + wrong);
  }
}

void check_batch(const VolumeRecords& all, const std::filesystem::path& file) {
  for (std::size_t i = 0; i < all.size(); ++i) {
    const char* wrong = record_fault(all.records[i], all.moments_of(i));
    if (!wrong && i > 0 && VolumeRecordOrder{}(all.records[i], all.records[i - 1]))
      wrong = "out of order";
    if (wrong)
      throw Error(ErrorKind::Internal,
                  file.string() + ": volume record " + std::to_string(i) + ": " + wrong);
  }
}

void sync_folder_of(const std::filesystem::path& file) {
  const std::filesystem::path parent =
      file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  const PosixFile folder(::open(parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC), parent);
  if (folder.is_open() && ::fsync(folder.descriptor()) != 0 && errno != EINVAL)
    throw Error(ErrorKind::Resource,
                parent.string() + ": cannot be synced to disk: " + std::strerror(errno));
}

}  // namespace brume
