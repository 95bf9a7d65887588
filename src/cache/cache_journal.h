// What a bake has gathered, on disk as it goes: FILE.part beside the cache FILE. Whatever ends the
// process, a later bake finds what was sealed and gathers none of it again.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <unordered_map>

#include "cache/cache_file.h"

namespace brume {

struct JournalOptions {
  std::chrono::milliseconds seal_interval{1000};  // What a kill costs at most.
  bool survives_power_loss = false;  // Syncs each block: then what a power cut costs, too.
  bool starts_anew = false;          // Drops what a part holds, whatever it is.
  // After each seal, with the number of surface records sealed in this process; from any thread, one at a
  // time.
  std::function<void(std::size_t)> on_sealed{};
};

class CacheJournal {
 public:
  // Locks FILE.part and reads what another process left there. Throws Error(Stopped) while another
  // writer holds it, Error(Resource) where it cannot be written, Error(InvalidInput) for a part of
  // other records (another fingerprint) or no part at all.
  CacheJournal(const std::filesystem::path& file, const CacheHeader& header,
               const JournalOptions& options);
  // Seals what was added, and keeps the part unless it holds no record.
  ~CacheJournal();
  CacheJournal(const CacheJournal&) = delete;
  CacheJournal& operator=(const CacheJournal&) = delete;

  // What was left there, as gathered; null for none. Any thread.
  const SurfaceRecord* find(int layer, std::uint64_t key) const;
  // The note that was added under that key, padded with zeros; empty for nothing. Any thread.
  std::span<const unsigned char> find_note(std::uint64_t key) const;
  // Any thread. Throws Error(Resource), then and whenever called again, when the disk fails. Who finds
  // the record finds the note that came with it under its key.
  void add(const SurfaceRecord& record, std::vector<unsigned char> note = {});
  void add_note(std::uint64_t key, std::vector<unsigned char> note);
  // Everything added is sealed and synced once it returns.
  void seal();
  // The cache itself holds it all now.
  void remove();

  // Nothing is sealed, by this process or one before.
  bool is_empty() const;
  const std::filesystem::path& part() const;

 private:
  struct Impl;
  void seal_if_due();
  void seal_locked();

  std::unique_ptr<Impl> impl_;
  std::unordered_map<std::uint64_t, SurfaceRecord> found_;
  std::unordered_map<std::uint64_t, std::vector<unsigned char>> found_notes_;
  std::mutex mutex_;
  std::vector<std::pair<std::uint64_t, std::vector<unsigned char>>> unsealed_notes_;
  std::vector<SurfaceRecord> unsealed_;
  std::chrono::steady_clock::time_point last_seal_ = std::chrono::steady_clock::now();
  JournalOptions options_;
  std::size_t added_ = 0, unsealed_count_ = 0;
};

// Whether a FILE.part with anything in it lies beside FILE: a bake to go on with.
bool has_part(const std::filesystem::path& file);

}  // namespace brume
