#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "cache/cache_file.h"
#include "cache/cache_layout.h"
#include "cache/posix_file.h"
#include "core/error.h"

namespace brume {
namespace {

using namespace cache_layout;
using Clock = std::chrono::steady_clock;

// How much a power loss may cost; nothing of it reaches the bytes.
constexpr std::uint64_t kSyncBytes = std::uint64_t(16) << 20;
constexpr std::chrono::seconds kSyncInterval{10};

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what, int error) {
  throw Error(ErrorKind::Resource, path.string() + ": cannot " + what + ": " + std::strerror(error));
}

bool is_same_file(const struct stat& a, const struct stat& b) {
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

// Opens `part` for this writer alone. The kernel drops the lock of a process that dies, so a part
// without a lock has no writer.
PosixFile open_part(const std::filesystem::path& file, const std::filesystem::path& part) {
  // A part may be renamed or removed between our open and our lock: then it is looked up again.
  for (int attempt = 0; attempt < 100; ++attempt) {
    int flags = O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
    PosixFile opened(::open(part.c_str(), flags | O_CREAT | O_EXCL, 0666), part);
    if (!opened.is_open() && errno == EEXIST) {
      opened = PosixFile(::open(part.c_str(), flags), part);
      if (!opened.is_open() && errno == ENOENT) continue;
    }
    if (!opened.is_open()) fail(part, "be created", errno);
    const struct stat ours = opened.status();
    if (!S_ISREG(ours.st_mode))
      throw Error(ErrorKind::Resource, part.string() + ": cannot be written: not a regular file");
    if (::flock(opened.descriptor(), LOCK_EX | LOCK_NB) != 0) {
      if (errno == EWOULDBLOCK)
        throw Error(ErrorKind::Stopped,
                    file.string() + ": locked: another process is writing " + part.string() +
                        ": wait for it");
      fail(part, "be locked", errno);
    }
    struct stat current {};
    if (::stat(part.c_str(), &current) == 0 && is_same_file(ours, current)) return opened;
  }
  throw Error(ErrorKind::Stopped, file.string() + ": locked: other processes keep replacing " +
                                      part.string() + ": try again");
}

}  // namespace

struct CacheWriter::Impl {
  std::filesystem::path file, part;
  PosixFile out;
  std::uint64_t end = 0;  // Where the valid prefix ends.
  std::uint64_t previous = 0;
  std::uint64_t records = 0;
  std::vector<BlockHeader> blocks;
  std::vector<std::uint64_t> block_sums;
  std::uint64_t unsynced = 0;
  Clock::time_point last_sync = Clock::now();
  std::vector<unsigned char> buffer;
  bool has_failed = false;

  // Runs a step that touches the disk. After a failure what the disk holds is unknown (a failed sync may
  // drop pages and succeed the next time), so nothing further is tried but cutting the part back.
  template <typename Step>
  void attempt(Step&& step) {
    if (!out.is_open())
      throw Error(ErrorKind::Internal, part.string() + ": written to after its end");
    if (has_failed)
      throw Error(ErrorKind::Resource, part.string() + ": not written: writing failed before");
    try {
      step();
    } catch (const Error&) {
      has_failed = true;
      // Best effort: a torn block does no harm, readers find where the chain ends.
      [[maybe_unused]] const int ignored = ::ftruncate(out.descriptor(), static_cast<off_t>(end));
      throw;
    }
  }

  void append(const unsigned char* bytes, std::size_t count) {
    out.write(bytes, count, end);
    end += count;
    unsynced += count;
  }

  void write_block(const SurfaceRecord* first, std::size_t count, bool ends_batch);
};

void CacheWriter::Impl::write_block(const SurfaceRecord* first, std::size_t count, bool ends_batch) {
  const std::size_t payload_bytes = count * sizeof(SurfaceRecord);
  if (end + kBlockHeaderBytes + payload_bytes > kMaxFileBytes)
    throw Error(ErrorKind::Resource, part.string() + ": cannot write " +
                                         std::to_string(payload_bytes) + " bytes at " +
                                         std::to_string(end) + ": over the format's 256 GiB");
  BlockHeader block;
  block.kind = static_cast<std::uint8_t>(RecordKind::Surface);
  block.layer = static_cast<std::uint8_t>(first->layer());
  block.wave = static_cast<std::uint8_t>(first->wave());
  block.flags = ends_batch ? kBatchEnds : 0;
  block.count = static_cast<std::uint32_t>(count);
  block.sequence = static_cast<std::uint32_t>(blocks.size());
  block.offset = end;
  block.cumulative = static_cast<std::uint32_t>(records);
  block.first_key = first->key;
  block.last_key = first[count - 1].key;
  block.previous = previous;
  block.payload_sum = hash64(first, payload_bytes);
  const BlockHeaderBytes header = encode_block_header(block);
  buffer.resize(kBlockHeaderBytes + payload_bytes);
  std::copy(header.begin(), header.end(), buffer.begin());
  std::memcpy(buffer.data() + kBlockHeaderBytes, first, payload_bytes);
  append(buffer.data(), buffer.size());
  previous = block_header_sum(header);
  records += count;
  blocks.push_back(block);
  block_sums.push_back(previous);
  if (unsynced >= kSyncBytes || Clock::now() - last_sync >= kSyncInterval) {
    out.sync_data();
    unsynced = 0;
    last_sync = Clock::now();
  }
}

CacheWriter::CacheWriter(const std::filesystem::path& file, const CacheHeader& header)
    : impl_(new Impl) {
  const HeaderBytes bytes = encode_header(header);
  impl_->file = file;
  impl_->part = file;
  impl_->part += ".part";
  struct stat target {};
  if (::stat(file.c_str(), &target) == 0 && !S_ISREG(target.st_mode))
    throw Error(ErrorKind::Resource, file.string() + ": cannot be replaced: not a regular file");
  impl_->out = open_part(file, impl_->part);
  impl_->attempt([&] {
    if (::ftruncate(impl_->out.descriptor(), 0) != 0) fail(impl_->part, "be emptied", errno);
    impl_->append(bytes.data(), bytes.size());
  });
  impl_->previous = header_sum(bytes);
}

CacheWriter::~CacheWriter() {
  if (impl_ && impl_->out.is_open() && !impl_->has_failed) ::unlink(impl_->part.c_str());
}

CacheWriter::CacheWriter(CacheWriter&&) noexcept = default;
CacheWriter& CacheWriter::operator=(CacheWriter&& other) noexcept {
  std::swap(impl_, other.impl_);
  return *this;
}

void CacheWriter::seal(const std::vector<SurfaceRecord>& records) {
  for (std::size_t i = 0; i < records.size(); ++i) {
    const char* wrong = record_fault(records[i]);
    if (!wrong && (records[i].flags & 0xffff) != (records[0].flags & 0xffff))
      wrong = "another layer or wave than the first";
    if (!wrong && i > 0 && RecordOrder{}(records[i], records[i - 1])) wrong = "out of order";
    if (wrong)
      throw Error(ErrorKind::Internal, impl_->part.string() + ": record " + std::to_string(i) +
                                           " of a batch: " + wrong);
  }
  impl_->attempt([&] {
    for (std::size_t i = 0; i < records.size(); i += kBlockRecords) {
      const std::size_t count = std::min(kBlockRecords, records.size() - i);
      impl_->write_block(&records[i], count, i + count == records.size());
    }
  });
}

void CacheWriter::finish() {
  impl_->attempt([&] {
    const std::uint64_t chain_end = impl_->end;
    const std::vector<unsigned char> tail =
        encode_tail(impl_->blocks, impl_->block_sums, chain_end);
    impl_->out.write(tail.data(), tail.size(), chain_end);
    impl_->out.sync();
    if (::rename(impl_->part.c_str(), impl_->file.c_str()) != 0)
      fail(impl_->part, "be renamed to " + impl_->file.string(), errno);
    impl_->end += tail.size();
    // The rename itself is durable only once its folder is.
    const std::filesystem::path parent =
        impl_->file.has_parent_path() ? impl_->file.parent_path() : std::filesystem::path(".");
    const PosixFile folder(::open(parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC), parent);
    // Some file systems have no such thing for folders and say EINVAL.
    if (folder.is_open() && ::fsync(folder.descriptor()) != 0 && errno != EINVAL)
      fail(parent, "be synced to disk", errno);
  });
  impl_->out.close();
}

void CacheWriter::leave() {
  impl_->attempt([&] { impl_->out.sync(); });
  impl_->out.close();
}

}  // namespace brume
