#include "stamped_archive.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <system_error>
#include <vector>

#include "child_process.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/staged_file.h"
#include "unique_fd.h"

namespace brume {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& file, const std::string& what, int error) {
  throw Error(ErrorKind::Resource,
              file.string() + ": " + what + ": " + std::generic_category().message(error));
}

// OpenVDB stamps each file with a random UUID, in text, after magic, versions and a flag. Ours is a
// hash of the rest, so that equal grids make equal files.
void stamp(const fs::path& file, std::vector<char>& bytes) {
  constexpr std::size_t kOffset = 8 + 4 + 4 + 4 + 1, kSize = 36;
  const auto is_uuid = [&] {
    if (bytes.size() < kOffset + kSize) return false;
    for (std::size_t i = 0; i < kSize; ++i) {
      const bool dash = i == 8 || i == 13 || i == 18 || i == 23;
      const char c = bytes[kOffset + i];
      if (dash ? c != '-' : !std::isxdigit(static_cast<unsigned char>(c))) return false;
    }
    return true;
  };
  if (!is_uuid())
    throw Error(ErrorKind::Internal,
                file.string() + ": this OpenVDB keeps its UUID at another place");
  std::fill_n(bytes.begin() + kOffset, kSize, '0');
  const std::string hex = FingerprintBuilder().add_bytes(bytes.data(), bytes.size()).finish().hex();
  std::string uuid;
  for (std::size_t i = 0; i < hex.size(); ++i) {
    if (i == 8 || i == 12 || i == 16 || i == 20) uuid += '-';
    uuid += hex[i];
  }
  std::copy(uuid.begin(), uuid.end(), bytes.begin() + kOffset);
}

std::vector<char> read_whole(const fs::path& file, int fd) {
  struct stat s {};
  if (::fstat(fd, &s) != 0) fail(file, "cannot be read back", errno);
  std::vector<char> bytes(static_cast<std::size_t>(s.st_size));
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = ::pread(fd, bytes.data() + done, bytes.size() - done, off_t(done));
    if (got <= 0) fail(file, "cannot be read back", got < 0 ? errno : EIO);
    done += static_cast<std::size_t>(got);
  }
  return bytes;
}

}  // namespace

void write_stamped_archive(const fs::path& file,
                           const std::function<void(const std::string& path)>& write) {
  // OpenVDB seeks while it writes and knows only paths, so it writes to a file in memory.
  const UniqueFd memory = make_memory_file("brume-grid-file");
  write("/proc/self/fd/" + std::to_string(memory.get()));
  std::vector<char> bytes = read_whole(file, memory.get());
  stamp(file, bytes);
  write_file_whole(file, {bytes.data(), bytes.size()});
}

}  // namespace brume
