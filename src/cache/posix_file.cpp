#include "cache/posix_file.h"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "core/error.h"

namespace brume {

PosixFile::PosixFile(int descriptor, std::filesystem::path path)
    : descriptor_(descriptor), path_(std::move(path)) {}

PosixFile::PosixFile(PosixFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), path_(std::move(other.path_)) {}

PosixFile& PosixFile::operator=(PosixFile&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(path_, other.path_);
  return *this;
}

void PosixFile::close() {
  if (is_open()) ::close(descriptor_);
  descriptor_ = -1;
}

void PosixFile::fail(const std::string& what, int error) const {
  throw Error(ErrorKind::Resource, path_.string() + ": cannot " + what + ": " + std::strerror(error));
}

struct stat PosixFile::status() const {
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) fail("be examined", errno);
  return status;
}

std::size_t PosixFile::read(unsigned char* bytes, std::size_t count, std::uint64_t offset) const {
  std::size_t done = 0;
  while (done < count) {
    const ssize_t got =
        ::pread(descriptor_, bytes + done, count - done, static_cast<off_t>(offset + done));
    if (got > 0) {
      done += static_cast<std::size_t>(got);
    } else if (got == 0) {
      break;
    } else if (errno != EINTR) {
      fail("read " + std::to_string(count) + " bytes at " + std::to_string(offset), errno);
    }
  }
  return done;
}

void PosixFile::write(const unsigned char* bytes, std::size_t count, std::uint64_t offset) const {
  std::size_t done = 0;
  while (done < count) {
    const ssize_t put =
        ::pwrite(descriptor_, bytes + done, count - done, static_cast<off_t>(offset + done));
    if (put > 0) {
      done += static_cast<std::size_t>(put);
    } else if (put == 0 || errno != EINTR) {
      fail("write " + std::to_string(count) + " bytes at " + std::to_string(offset),
           put == 0 ? ENOSPC : errno);
    }
  }
}

void PosixFile::sync_data() const {
  while (::fdatasync(descriptor_) != 0)
    if (errno != EINTR) fail("be synced to disk", errno);
}

void PosixFile::sync() const {
  while (::fsync(descriptor_) != 0)
    if (errno != EINTR) fail("be synced to disk", errno);
}

}  // namespace brume
