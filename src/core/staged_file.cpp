#include "core/staged_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <system_error>

#include "core/error.h"

namespace brume {
namespace {

constexpr int kNameAttempts = 10000;

std::filesystem::path folder_of(const std::filesystem::path& file) {
  return file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
}

}  // namespace

StagedFile::StagedFile(const std::filesystem::path& file) : file_(file) {
  if (!file.has_filename()) fail("it names a folder, not a file", 0);
  static std::atomic<unsigned> counter{0};
  for (int attempt = 0; attempt < kNameAttempts; ++attempt) {
    staged_ = file;
    const std::string process = std::to_string(getpid()), number = std::to_string(counter++);
    staged_ += "." + process + "-" + number + ".part";
    // Exclusive creation: process numbers repeat between the hosts of a shared disk.
    descriptor_ = open(staged_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor_ >= 0) break;
    if (errno != EEXIST) fail("cannot be created", errno);
  }
  if (descriptor_ < 0) fail("cannot be created", EEXIST);
  // A folder under the final name would only fail at the rename, after all the work.
  std::error_code ignored;
  if (std::filesystem::is_directory(file_, ignored)) {
    close(descriptor_);
    unlink(staged_.c_str());
    fail("it is a folder", 0);
  }
}

StagedFile::~StagedFile() {
  if (descriptor_ < 0) return;
  close(descriptor_);
  unlink(staged_.c_str());
}

bool StagedFile::write(const void* data, std::size_t bytes) noexcept {
  if (failed_) return false;
  const char* from = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t n = ::write(descriptor_, from, bytes);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      remember("cannot be written", n < 0 ? errno : ENOSPC);
      return false;
    }
    from += n;
    offset_ += n;
    bytes -= static_cast<std::size_t>(n);
  }
  return true;
}

bool StagedFile::seek(std::int64_t offset) noexcept {
  if (failed_) return false;
  if (lseek(descriptor_, offset, SEEK_SET) != offset) {
    remember("cannot be positioned", errno);
    return false;
  }
  offset_ = offset;
  return true;
}

void StagedFile::commit() {
  if (!failed_ && fsync(descriptor_) != 0) remember("cannot be synced to disk", errno);
  // Network file systems report a full disk at close.
  if (close(descriptor_) != 0 && !failed_) remember("cannot be closed", errno);
  descriptor_ = -1;
  if (!failed_ && rename(staged_.c_str(), file_.c_str()) != 0)
    remember("cannot be renamed into place", errno);
  if (failed_) {
    unlink(staged_.c_str());
    fail(failed_, error_number_);
  }
  // The new name itself must survive a power cut. Some file systems cannot sync a folder (EINVAL);
  // there is nothing better to do on those.
  const int folder = open(folder_of(file_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder < 0) return;
  const bool synced = fsync(folder) == 0 || errno == EINVAL;
  const int error_number = errno;
  close(folder);
  if (!synced) fail("its folder cannot be synced to disk", error_number);
}

void StagedFile::remember(const char* what, int error_number) noexcept {
  if (failed_) return;
  failed_ = what;
  error_number_ = error_number;
}

void StagedFile::fail(const char* what, int error_number) const {
  std::string message = printable(file_.string()) + ": " + what;
  if (error_number != 0) message += ": " + std::generic_category().message(error_number);
  if (offset_ > 0) message += " (after " + std::to_string(offset_) + " bytes)";
  throw Error(ErrorKind::Resource, message + ": choose a folder with space and write permission");
}

void write_file_whole(const std::filesystem::path& file, std::string_view bytes) {
  StagedFile staged(file);
  staged.write(bytes.data(), bytes.size());
  staged.commit();
}

}  // namespace brume
