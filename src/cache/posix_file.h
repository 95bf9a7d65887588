// A file descriptor that closes itself and tells its troubles as Error. Private to cache/.
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <filesystem>
#include <string>

namespace brume {

class PosixFile {
 public:
  PosixFile() = default;
  // Takes `descriptor`; -1 is a file that is not open. `path` is for messages.
  PosixFile(int descriptor, std::filesystem::path path);
  ~PosixFile() { close(); }
  PosixFile(PosixFile&& other) noexcept;
  PosixFile& operator=(PosixFile&& other) noexcept;

  bool is_open() const { return descriptor_ >= 0; }
  int descriptor() const { return descriptor_; }
  const std::filesystem::path& path() const { return path_; }
  void close();

  // All of these throw Error(Resource) naming the path (and the bytes).
  struct stat status() const;
  // Fewer than `count` only at the file's end.
  std::size_t read(unsigned char* bytes, std::size_t count, std::uint64_t offset) const;
  // All of them, in one call unless the system cuts it short.
  void write(const unsigned char* bytes, std::size_t count, std::uint64_t offset) const;
  void sync_data() const;
  void sync() const;

 private:
  [[noreturn]] void fail(const std::string& what, int error) const;

  int descriptor_ = -1;
  std::filesystem::path path_;
};

}  // namespace brume
