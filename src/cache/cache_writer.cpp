#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "cache/block_chain.h"
#include "cache/cache_file.h"
#include "cache/cache_journal.h"
#include "cache/cache_lock.h"
#include "cache/irradiance_cache.h"
#include "core/error.h"

namespace brume {
namespace {

std::filesystem::path next_of(const std::filesystem::path& file) {
  std::filesystem::path next = file;
  next += ".next";
  return next;
}

// Who holds the lock has no rival for it, so what lies there was left by a writer that died.
PosixFile create_next(const std::filesystem::path& file) {
  const std::filesystem::path next = next_of(file);
  ::unlink(next.c_str());
  PosixFile created(::open(next.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0666),
                    next);
  if (!created.is_open())
    throw Error(ErrorKind::Resource,
                next.string() + ": cannot be created: " + std::strerror(errno));
  return created;
}

}  // namespace

struct CacheWriter::Impl {
  Impl(const std::filesystem::path& file_, const CacheHeader& header, const CacheJournal* journal)
      : file(file_), lock(journal ? PosixFile() : lock_part(file_)), chain(create_next(file_)) {
    try {
      chain.write_header(header);
    } catch (...) {
      abandon();
      throw;
    }
  }
  void abandon() {
    if (!chain.file().is_open()) return;
    ::unlink(chain.file().path().c_str());
    chain.close();
    remove_empty_part(lock);
  }

  std::filesystem::path file;
  PosixFile lock;
  BlockChain chain;
};

CacheWriter::CacheWriter(const std::filesystem::path& file, const CacheHeader& header,
                         const CacheJournal* journal) {
  (void)cache_layout::encode_header(header);  // Refuses a bad one before anything is created.
  impl_ = std::make_unique<Impl>(file, header, journal);
}

CacheWriter::~CacheWriter() {
  if (impl_) impl_->abandon();
}

CacheWriter::CacheWriter(CacheWriter&&) noexcept = default;
CacheWriter& CacheWriter::operator=(CacheWriter&& other) noexcept {
  std::swap(impl_, other.impl_);
  return *this;
}

void CacheWriter::seal(const std::vector<SurfaceRecord>& records) {
  check_batch(records, impl_->file);
  impl_->chain.write_records(records, 0);
}

void CacheWriter::seal_deep(const VolumeRecords& records, const std::string& solve) {
  check_batch(records, impl_->file);
  impl_->chain.write_records(records);
  const std::vector<unsigned char> bytes(solve.begin(), solve.end());
  impl_->chain.write_note(cache_layout::kKeyOfSolve, bytes, 0);
}

void CacheWriter::seal_checks(const std::string& checks) {
  const std::vector<unsigned char> bytes(checks.begin(), checks.end());
  impl_->chain.write_note(cache_layout::kKeyOfChecks, bytes, 0);
}

void CacheWriter::seal_order(int layer, std::span<const std::uint32_t> order) {
  impl_->chain.write_order(layer, order);
}

void CacheWriter::finish() {
  impl_->chain.write_tail();
  const std::filesystem::path next = impl_->chain.file().path();
  if (::rename(next.c_str(), impl_->file.c_str()) != 0)
    throw Error(ErrorKind::Resource, next.string() + ": cannot be renamed to " +
                                         impl_->file.string() + ": " + std::strerror(errno));
  impl_->chain.close();
  remove_empty_part(impl_->lock);
  impl_->lock.close();
  sync_folder_of(impl_->file);  // The rename itself is durable only once its folder is.
}

void write_cache(const std::filesystem::path& file, CacheHeader header,
                 const IrradianceCache& cache, const CacheNotes& notes,
                 const CacheJournal* journal) {
  header.volume_order = volume_order_of(cache.volume()->all());
  CacheWriter writer(file, header, journal);
  const auto records = cache.records();
  bool is_deep_sealed = false;
  const auto end_deep = [&] {
    if (!is_deep_sealed) writer.seal_deep(cache.volume()->all(), notes.solve);
    is_deep_sealed = true;
  };
  for (auto run = records.begin(); run != records.end();) {
    if (run->layer() != kDeepLayer) end_deep();
    auto end = run;
    while (end != records.end() && end->layer() == run->layer() && end->wave() == run->wave())
      ++end;
    writer.seal({run, end});
    run = end;
  }
  end_deep();
  writer.seal_checks(notes.checks);
  for (int layer = 0; layer < cache.layers(); ++layer)
    if (const auto order = cache.curve_order(layer); !order.empty())
      writer.seal_order(layer, order);
  writer.finish();
}

}  // namespace brume
