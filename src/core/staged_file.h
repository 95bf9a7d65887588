// A file that appears whole or not at all: written beside its final name, synced, then renamed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string_view>

namespace brume {

// Until commit() returns, the final name keeps what it held before, and whatever goes wrong (an
// exception included) removes the staged copy. One thread at a time.
class StagedFile {
 public:
  // Creates `NAME.PID-N.part` in the same folder, so that the rename never crosses file systems.
  // Throws Error(Resource) naming `file` where that is impossible.
  explicit StagedFile(const std::filesystem::path& file);
  ~StagedFile();
  StagedFile(const StagedFile&) = delete;
  StagedFile& operator=(const StagedFile&) = delete;

  // False once anything has failed; commit() then says what. Callable from code that must not see
  // exceptions.
  bool write(const void* data, std::size_t bytes) noexcept;
  bool seek(std::int64_t offset) noexcept;
  std::int64_t tell() const noexcept { return offset_; }
  bool has_failed() const noexcept { return failed_ != nullptr; }

  // Data reaches the disk, then the name, then the folder. Throws Error(Resource).
  void commit();

 private:
  [[noreturn]] void fail(const char* what, int error_number) const;
  void remember(const char* what, int error_number) noexcept;

  std::filesystem::path file_, staged_;
  int descriptor_ = -1;
  std::int64_t offset_ = 0;
  const char* failed_ = nullptr;  // What failed first, and why.
  int error_number_ = 0;
};

// The whole of it for small files.
void write_file_whole(const std::filesystem::path& file, std::string_view bytes);

}  // namespace brume
