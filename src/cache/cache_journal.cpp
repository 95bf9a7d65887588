#include "cache/cache_journal.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "cache/block_chain.h"
#include "cache/cache_lock.h"
#include "cache/chain_reader.h"
#include "core/error.h"

namespace brume {
namespace {

// Layers may gather at the same point, with the same key.
std::uint64_t slot_of(int layer, std::uint64_t key) {
  return key + 0x9e3779b97f4a7c15ULL * static_cast<std::uint64_t>(layer + 1);
}

[[noreturn]] void refuse(const std::filesystem::path& part, const std::string& what) {
  throw Error(ErrorKind::InvalidInput,
              part.string() + ": " + what + ": remove it, or use --cache-mode new to begin again");
}

}  // namespace

struct CacheJournal::Impl {
  explicit Impl(PosixFile part, ChainState state) : chain(std::move(part), std::move(state)) {}
  BlockChain chain;
};

CacheJournal::CacheJournal(const std::filesystem::path& file, const CacheHeader& header,
                           const JournalOptions& options)
    : options_(options) {
  PosixFile part = lock_part(file);
  // A writer that died before its header was whole sealed nothing.
  const auto bytes = static_cast<std::uint64_t>(part.status().st_size);
  ChainState state;
  if (!options_.starts_anew && bytes >= cache_layout::kHeaderBytes) {
    ChainReading reading = read_chain(part, bytes, {.keeps_notes = true});
    const CacheContents& held = reading.check.opening.contents;
    if (reading.check.valid_bytes < cache_layout::kHeaderBytes)
      refuse(part.path(), reading.check.opening.reason);
    if (held.header.fingerprint != header.fingerprint || held.header.origin != header.origin)
      refuse(part.path(), "stale: the unfinished bake of another scene or other settings");
    state = std::move(reading.state);
    found_notes_ = std::move(reading.notes);
    for (const SurfaceRecord& record : held.records)
      if (!record_fault(record)) found_.emplace(slot_of(record.layer(), record.key), record);
  }
  if (::ftruncate(part.descriptor(), static_cast<off_t>(state.end)) != 0)
    throw Error(ErrorKind::Resource,
                part.path().string() + ": cannot be cut back: " + std::strerror(errno));
  const bool is_new = state.end == 0;
  impl_ = std::make_unique<Impl>(std::move(part), std::move(state));
  if (options_.survives_power_loss) impl_->chain.sync_each_block();
  if (!is_new) return;
  try {
    impl_->chain.write_header(header);
    if (options_.survives_power_loss) sync_folder_of(file);
  } catch (...) {
    ::unlink(impl_->chain.file().path().c_str());
    throw;
  }
}

CacheJournal::~CacheJournal() {
  if (!impl_->chain.file().is_open()) return;
  try {
    seal();
  } catch (const Error&) {
    // Whoever added the records was told; what is sealed stays.
  }
  if (is_empty()) ::unlink(part().c_str());
}

bool CacheJournal::is_empty() const { return impl_->chain.end() <= cache_layout::kHeaderBytes; }

const std::filesystem::path& CacheJournal::part() const { return impl_->chain.file().path(); }

const SurfaceRecord* CacheJournal::find(int layer, std::uint64_t key) const {
  const auto it = found_.find(slot_of(layer, key));
  return it != found_.end() && it->second.key == key && it->second.layer() == layer ? &it->second
                                                                                    : nullptr;
}

std::span<const unsigned char> CacheJournal::find_note(std::uint64_t key) const {
  const auto it = found_notes_.find(key);
  if (it == found_notes_.end()) return {};
  return it->second;
}

void CacheJournal::add(const SurfaceRecord& record, std::vector<unsigned char> note) {
  const std::lock_guard lock(mutex_);
  unsealed_.push_back(record);
  if (!note.empty()) unsealed_notes_.emplace_back(record.key, std::move(note));
  seal_if_due();
}

void CacheJournal::add_note(std::uint64_t key, std::vector<unsigned char> note) {
  const std::lock_guard lock(mutex_);
  unsealed_notes_.emplace_back(key, std::move(note));
  seal_if_due();
}

void CacheJournal::seal_if_due() {
  ++unsealed_count_;
  if (unsealed_count_ >= CacheWriter::kBlockRecords ||
      std::chrono::steady_clock::now() - last_seal_ >= options_.seal_interval)
    seal_locked();
}

void CacheJournal::seal() {
  const std::lock_guard lock(mutex_);
  seal_locked();
  impl_->chain.sync();
}

void CacheJournal::seal_locked() {
  // Notes first: a record that is found vouches for its note.
  std::sort(unsealed_notes_.begin(), unsealed_notes_.end());
  for (const auto& [key, note] : unsealed_notes_)
    impl_->chain.write_note(key, note, cache_layout::kAsGathered);
  unsealed_notes_.clear();
  std::sort(unsealed_.begin(), unsealed_.end(), RecordOrder{});
  for (auto run = unsealed_.begin(); run != unsealed_.end();) {
    auto end = run;
    while (end != unsealed_.end() && (end->flags & 0xffff) == (run->flags & 0xffff)) ++end;
    const std::span<const SurfaceRecord> batch(run, end);
    check_batch(batch, part());
    impl_->chain.write_records(batch, cache_layout::kAsGathered);
    run = end;
  }
  added_ += unsealed_.size();
  const bool is_any = unsealed_count_ > 0;
  unsealed_.clear();
  unsealed_count_ = 0;
  last_seal_ = std::chrono::steady_clock::now();
  if (is_any && options_.on_sealed) options_.on_sealed(added_);
}

void CacheJournal::remove() {
  // The name goes before the lock, so that nobody finds a part that is about to go.
  ::unlink(part().c_str());
  impl_->chain.close();
}

bool has_part(const std::filesystem::path& file) {
  std::error_code error;
  const auto bytes = std::filesystem::file_size(part_of(file), error);
  return !error && bytes > 0;
}

}  // namespace brume
