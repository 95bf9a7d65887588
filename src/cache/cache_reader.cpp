#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "cache/cache_file.h"
#include "cache/chain_reader.h"
#include "core/error.h"

namespace brume {
namespace {

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
  return read_chain(opened, static_cast<std::uint64_t>(status.st_size),
                    {expected, stop_at_bad_records})
      .check;
}

}  // namespace

bool ShardSet::is_valid() const {
  if (count > kMaxShards || (count == 0 && !done.empty())) return false;
  for (std::size_t i = 0; i < done.size(); ++i)
    if (done[i] >= count || (i > 0 && done[i] <= done[i - 1])) return false;
  return true;
}

std::vector<std::uint32_t> ShardSet::missing() const {
  std::vector<std::uint32_t> rest;
  auto next = done.begin();
  for (std::uint32_t i = 0; i < count; ++i)
    if (next != done.end() && *next == i)
      ++next;
    else
      rest.push_back(i);
  return rest;
}

CacheOpening open_cache(const std::filesystem::path& file, const std::optional<Fingerprint>& expected) {
  return examine(file, expected, true).opening;
}

CacheCheck check_cache(const std::filesystem::path& file) { return examine(file, std::nullopt, false); }

}  // namespace brume
