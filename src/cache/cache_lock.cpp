#include "cache/cache_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "core/error.h"

namespace brume {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what, int error) {
  throw Error(ErrorKind::Resource,
              path.string() + ": cannot " + what + ": " + std::strerror(error));
}

bool is_same_file(const struct stat& a, const struct stat& b) {
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

}  // namespace

std::filesystem::path part_of(const std::filesystem::path& file) {
  std::filesystem::path part = file;
  part += ".part";
  return part;
}

PosixFile lock_part(const std::filesystem::path& file) {
  const std::filesystem::path part = part_of(file);
  struct stat target {};
  if (::stat(file.c_str(), &target) == 0) {
    if (!S_ISREG(target.st_mode))
      throw Error(ErrorKind::Resource, file.string() + ": cannot be replaced: not a regular file");
  } else if (errno !=
             ENOENT) {  // A loop of links would be replaced, a file as a folder not be found.
    fail(file, "be written", errno);
  }
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
        throw Error(ErrorKind::Stopped, file.string() + ": locked: another process is writing " +
                                            part.string() + ": wait for it");
      fail(part, "be locked", errno);
    }
    struct stat current {};
    if (::stat(part.c_str(), &current) == 0 && is_same_file(ours, current)) return opened;
  }
  throw Error(ErrorKind::Stopped, file.string() + ": locked: other processes keep replacing " +
                                      part.string() + ": try again");
}

void remove_empty_part(const PosixFile& part) {
  if (part.is_open() && part.status().st_size == 0) ::unlink(part.path().c_str());
}

}  // namespace brume
