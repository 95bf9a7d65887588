// Loaded before the C library's own (LD_PRELOAD): makes one call on a cache file fail, or kills the
// process at it. Settings come from the environment:
//
//   FAULT_CALL    write, sync, rename, truncate or unlink
//   FAULT_NUMBER  which of its calls on names that have ".irc" in them, from 1
//   FAULT_ACTION  an errno by name (EIO, ENOSPC, EACCES), "short" (half of a write is done), "kill"
//   (before the
//                 call), "kill_after", or "clock" (no call fails; the wall clock jumps by years
//                 instead)
#include <dlfcn.h>
#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace {

std::atomic<int> calls;

bool is_cache(const char* name) { return std::strstr(name, ".irc") != nullptr; }

bool is_cache_descriptor(int descriptor) {
  char link[64], name[4096];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
  const ssize_t length = readlink(link, name, sizeof name - 1);
  if (length < 0) return false;
  name[length] = 0;
  return is_cache(name);
}

// The action for this call, or null.
const char* fault(const char* call) {
  const char* wanted = std::getenv("FAULT_CALL");
  const char* number = std::getenv("FAULT_NUMBER");
  if (!wanted || !number || std::strcmp(wanted, call) != 0) return nullptr;
  return ++calls == std::atoi(number) ? std::getenv("FAULT_ACTION") : nullptr;
}

bool is(const char* action, const char* name) { return action && std::strcmp(action, name) == 0; }

// Whether the call is to fail, with errno set.
bool fails(const char* action) {
  if (!action || is(action, "kill_after") || is(action, "short")) return false;
  if (is(action, "kill")) raise(SIGKILL);
  errno = is(action, "EIO") ? EIO : is(action, "ENOSPC") ? ENOSPC : EACCES;
  return true;
}

// The C library's own.
template <typename Function>
Function* real(Function*, const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}
#define REAL(name) real(&name, #name)

template <typename Call>
auto around(const char* action, Call&& call) -> decltype(call()) {
  if (fails(action)) return -1;
  const auto result = call();
  if (is(action, "kill_after")) raise(SIGKILL);
  return result;
}

ssize_t faulty_pwrite(int descriptor, const void* bytes, size_t count, off_t offset) {
  const char* action = is_cache_descriptor(descriptor) ? fault("write") : nullptr;
  const size_t part = is(action, "short") ? (count + 1) / 2 : count;
  return around(action, [&] { return REAL(pwrite)(descriptor, bytes, part, offset); });
}

}  // namespace

extern "C" {

ssize_t pwrite(int descriptor, const void* bytes, size_t count, off_t offset) {
  return faulty_pwrite(descriptor, bytes, count, offset);
}
ssize_t pwrite64(int descriptor, const void* bytes, size_t count, off_t offset) {
  return faulty_pwrite(descriptor, bytes, count, offset);
}

int fsync(int descriptor) {
  return around(is_cache_descriptor(descriptor) ? fault("sync") : nullptr,
                [&] { return REAL(fsync)(descriptor); });
}
int fdatasync(int descriptor) {
  return around(is_cache_descriptor(descriptor) ? fault("sync") : nullptr,
                [&] { return REAL(fdatasync)(descriptor); });
}
int ftruncate(int descriptor, off_t size) noexcept {
  return around(is_cache_descriptor(descriptor) ? fault("truncate") : nullptr,
                [&] { return REAL(ftruncate)(descriptor, size); });
}
int ftruncate64(int descriptor, off_t size) noexcept { return ftruncate(descriptor, size); }
int rename(const char* from, const char* to) noexcept {
  return around(is_cache(to) ? fault("rename") : nullptr, [&] { return REAL(rename)(from, to); });
}
int unlink(const char* name) noexcept {
  return around(is_cache(name) ? fault("unlink") : nullptr, [&] { return REAL(unlink)(name); });
}

int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const int result = REAL(clock_gettime)(clock, time);
  if (clock == CLOCK_REALTIME && is(std::getenv("FAULT_ACTION"), "clock"))
    time->tv_sec += (++calls % 2 ? 1 : -1) * 100'000'000;
  return result;
}

}  // extern "C"
