#include "scene/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "core/error.h"

namespace brume {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& what,
                       const std::string& what_to_do) {
  throw Error(ErrorKind::InvalidInput, printable(file.string()) + ": " + what + ": " + what_to_do);
}

class OpenFile {
 public:
  explicit OpenFile(const std::filesystem::path& file)
      : file_(file), fd_(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY)) {
    if (fd_ < 0)
      fail(file, std::string("cannot open it, ") + std::strerror(errno), "check the path");
    struct stat info;
    const bool known = ::fstat(fd_, &info) == 0;
    if (!known || !S_ISREG(info.st_mode)) {
      ::close(fd_);
      fail(file, known && S_ISDIR(info.st_mode) ? "this is a folder" : "this is not a regular file",
           "name a file");
    }
    size_ = static_cast<std::uint64_t>(info.st_size);
  }
  ~OpenFile() { ::close(fd_); }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  // Reads to the end, wherever that now is: files may grow or shrink while they are read.
  std::string read(std::uint64_t max_bytes) {
    if (size_ > max_bytes) too_large(max_bytes);
    std::string text;
    constexpr std::size_t kChunk = 1 << 20;
    while (true) {
      const std::size_t have = text.size();
      text.resize(have + std::max<std::size_t>(kChunk, size_ > have ? size_ - have : 0));
      const ssize_t got = ::read(fd_, text.data() + have, text.size() - have);
      if (got < 0 && errno != EINTR)
        fail(file_, std::string("cannot read it, ") + std::strerror(errno), "check the disk");
      text.resize(have + static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
      if (got == 0) return text;
      if (text.size() > max_bytes) too_large(max_bytes);
    }
  }

 private:
  [[noreturn]] void too_large(std::uint64_t max_bytes) const {
    fail(file_, "larger than " + std::to_string(max_bytes) + " bytes",
         "is this the file that was meant?");
  }

  std::filesystem::path file_;
  int fd_;
  std::uint64_t size_ = 0;
};

}  // namespace

void check_confined(const std::filesystem::path& file,
                    const std::optional<std::filesystem::path>& folder) {
  if (!folder) return;
  std::error_code failed;
  const auto root = std::filesystem::canonical(*folder, failed);
  if (failed) fail(*folder, "cannot confine to it, " + failed.message(), "name a folder");
  const auto real = std::filesystem::weakly_canonical(std::filesystem::absolute(file), failed);
  if (failed) fail(file, "cannot be resolved, " + failed.message(), "check the path");
  const auto parts = std::mismatch(root.begin(), root.end(), real.begin(), real.end());
  if (parts.first != root.end())
    fail(file, "leaves the folder " + printable(root.string()),
         "move it inside, or run without --confine");
}

void check_regular_file(const std::filesystem::path& file) { OpenFile{file}; }

std::string read_regular_file(const std::filesystem::path& file, std::uint64_t max_bytes) {
  return OpenFile(file).read(max_bytes);
}

}  // namespace brume
