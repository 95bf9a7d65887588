#include "child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <string>
#include <system_error>

#include "core/error.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define BRUME_SANITIZED 1
#else
#define BRUME_SANITIZED 0
#endif

namespace brume {
namespace {

using Clock = std::chrono::steady_clock;

// Of standard error: enough for an assertion's text.
constexpr std::size_t kMaxMessage = 4096;

[[noreturn]] void fail(const std::string& what, int error) {
  throw Error(ErrorKind::Resource,
              "grid loader: " + what + ": " + std::generic_category().message(error));
}

// Above the standard descriptors and those the child is given, whatever the caller has closed.
UniqueFd move_up(int fd, const char* what) {
  const UniqueFd low(fd);
  const int high = ::fcntl(fd, F_DUPFD_CLOEXEC, 10);
  if (high < 0) fail(what, errno);
  return UniqueFd(high);
}

class SpawnSettings {
 public:
  SpawnSettings() {
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
  }
  ~SpawnSettings() {
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
  }
  SpawnSettings(const SpawnSettings&) = delete;
  SpawnSettings& operator=(const SpawnSettings&) = delete;

  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
};

pid_t spawn_self(const std::string& argument, int request_fd, int result_fd, int error_fd) {
  SpawnSettings s;
  int failed = 0;
  const auto check = [&](int error) { failed = failed ? failed : error; };
  check(posix_spawn_file_actions_addopen(&s.actions, 0, "/dev/null", O_RDONLY, 0));
  check(posix_spawn_file_actions_addopen(&s.actions, 1, "/dev/null", O_WRONLY, 0));
  check(posix_spawn_file_actions_adddup2(&s.actions, error_fd, 2));
  check(posix_spawn_file_actions_adddup2(&s.actions, request_fd, kRequestFd));
  check(posix_spawn_file_actions_adddup2(&s.actions, result_fd, kResultFd));
  check(posix_spawn_file_actions_addclosefrom_np(&s.actions, kResultFd + 1));

  // Signals as a fresh program has them, and a process group of its own: a Ctrl-C meant for the
  // parent, which may have things to save, must not look like a crash of the reader.
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  check(posix_spawnattr_setsigmask(&s.attributes, &none));
  check(posix_spawnattr_setsigdefault(&s.attributes, &all));
  check(posix_spawnattr_setpgroup(&s.attributes, 0));
  check(posix_spawnattr_setflags(
      &s.attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP));
  if (failed) fail("cannot describe the child process", failed);

  std::string name = "brume-grid-loader", option = argument, parent = std::to_string(::getpid());
  char* const argv[] = {name.data(), option.data(), parent.data(), nullptr};
  pid_t child = -1;
  if (const int error =
          posix_spawn(&child, "/proc/self/exe", &s.actions, &s.attributes, argv, environ))
    fail("cannot start /proc/self/exe", error);
  return child;
}

// Keeps the end of what was written; everything is read, so that the child never blocks.
struct Tail {
  std::string text;
  void add(const char* data, std::size_t size) {
    text.append(data, size);
    if (text.size() > 2 * kMaxMessage) text.erase(0, text.size() - kMaxMessage);
  }
  std::string last_line() const {
    std::size_t end = text.find_last_not_of("\r\n");
    if (end == std::string::npos) return {};
    const std::size_t begin = text.find_last_of('\n', end);
    return printable(text.substr(begin == std::string::npos ? 0 : begin + 1,
                                 end - (begin == std::string::npos ? 0 : begin + 1) + 1));
  }
};

// Reads until every copy of the pipe's other end is closed or time is up.
void drain(int fd, Clock::time_point deadline, Tail& tail) {
  for (;;) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
    if (left <= 0) return;
    pollfd p{fd, POLLIN, 0};
    const int ready = ::poll(&p, 1, static_cast<int>(std::min<long long>(left, 60'000)));
    if (ready < 0 && errno != EINTR) return;
    if (ready <= 0) continue;
    char buffer[4096];
    const ssize_t got = ::read(fd, buffer, sizeof buffer);
    if (got == 0 || (got < 0 && errno != EINTR && errno != EAGAIN)) return;
    if (got > 0) tail.add(buffer, static_cast<std::size_t>(got));
  }
}

// A killed child's status, or nothing once `deadline` has passed.
bool wait_until(pid_t child, Clock::time_point deadline, int* status) {
  timespec pause{0, 200'000};
  for (;;) {
    const pid_t got = ::waitpid(child, status, WNOHANG);
    if (got == child) return true;
    if (got < 0 && errno != EINTR) fail("cannot wait for the child process", errno);
    if (Clock::now() >= deadline) return false;
    ::nanosleep(&pause, nullptr);
    pause.tv_nsec = std::min(pause.tv_nsec * 2, 10'000'000L);
  }
}

std::uint64_t read_number(const std::string& file) {
  std::ifstream in(file);
  std::uint64_t value = 0;
  return in >> value ? value : std::numeric_limits<std::uint64_t>::max();
}

// The tightest memory limit of this process's cgroup (version 2, then 1) and those above it.
std::uint64_t cgroup_memory_limit() {
  std::uint64_t limit = std::min(read_number("/sys/fs/cgroup/memory.max"),
                                 read_number("/sys/fs/cgroup/memory/memory.limit_in_bytes"));
  std::ifstream in("/proc/self/cgroup");
  for (std::string line; std::getline(in, line);) {
    const bool version2 = line.starts_with("0::/");
    const std::size_t memory = line.find(":memory:/");
    if (!version2 && memory == std::string::npos) continue;
    std::string group = version2 ? line.substr(3) : line.substr(memory + 8);
    while (group.size() > 1) {
      limit = std::min(limit, version2 ? read_number("/sys/fs/cgroup" + group + "/memory.max")
                                       : read_number("/sys/fs/cgroup/memory" + group +
                                                     "/memory.limit_in_bytes"));
      group.erase(group.find_last_of('/'));
    }
  }
  return limit;
}

std::uint64_t mapped_bytes() {
  const std::uint64_t pages = read_number("/proc/self/statm");
  return pages == std::numeric_limits<std::uint64_t>::max()
             ? 0
             : pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

bool limit(__rlimit_resource what, std::uint64_t value) {
  rlimit r{};
  if (::getrlimit(what, &r) != 0) return false;
  // A tighter limit that somebody else has set stays.
  const rlim_t v = std::min<rlim_t>(value, r.rlim_max);
  r.rlim_cur = r.rlim_max = v;
  return ::setrlimit(what, &r) == 0;
}

}  // namespace

UniqueFd make_memory_file(const char* name) {
  const int fd = ::memfd_create(name, MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (fd < 0) fail("cannot make a file in memory", errno);
  return move_up(fd, "cannot make a file in memory");
}

bool seal_memory_file(int fd) {
  return ::fcntl(fd, F_ADD_SEALS, F_SEAL_SHRINK | F_SEAL_GROW | F_SEAL_WRITE | F_SEAL_SEAL) == 0;
}

ChildOutcome run_child_of_self(const std::string& argument, int request_fd, int result_fd,
                               double timeout_s) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) fail("cannot make a pipe", errno);
  UniqueFd low_write(ends[1]);
  const UniqueFd read_end = move_up(ends[0], "cannot make a pipe");
  const int high = ::fcntl(low_write.get(), F_DUPFD_CLOEXEC, 10);
  if (high < 0) fail("cannot make a pipe", errno);
  UniqueFd write_end(high);
  low_write.reset();

  const auto deadline = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                           std::chrono::duration<double>(timeout_s));
  const pid_t child = spawn_self(argument, request_fd, result_fd, write_end.get());
  write_end.reset();

  Tail tail;
  int status = 0;
  drain(read_end.get(), deadline, tail);
  ChildOutcome outcome;
  if (!wait_until(child, deadline, &status)) {
    ::kill(child, SIGKILL);
    outcome.ending = ChildOutcome::Ending::TimedOut;
    // A killed process may still linger in the kernel, on a dead network disk for example.
    wait_until(child, Clock::now() + std::chrono::seconds(2), &status);
    return outcome;
  }
  outcome.message = tail.last_line();
  if (WIFEXITED(status)) {
    outcome.code = WEXITSTATUS(status);
  } else {
    outcome.code = WTERMSIG(status);
    outcome.ending =
        outcome.code == SIGXCPU ? ChildOutcome::Ending::TimedOut : ChildOutcome::Ending::Signalled;
  }
  return outcome;
}

std::uint64_t default_memory_limit() {
  const std::uint64_t ram = static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) *
                            static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return std::min(ram, cgroup_memory_limit()) / 2;
}

bool bind_to_parent(pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  // Crash reporters that core_pattern pipes to do not heed RLIMIT_CORE; this they do. (The leak
  // checker of sanitizer builds needs to look into the process.)
  if (!BRUME_SANITIZED) ::prctl(PR_SET_DUMPABLE, 0);
  if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return false;
  return ::getppid() == parent;
}

bool apply_limits(const ChildLimits& limits) {
  // With it ignored a write past the limit fails with EFBIG, which has a message.
  ::signal(SIGXFSZ, SIG_IGN);
  // Address sanitizers reserve terabytes of address space at start.
  const bool memory = BRUME_SANITIZED || limit(RLIMIT_AS, mapped_bytes() + limits.memory_bytes);
  return memory && limit(RLIMIT_CORE, 0) && limit(RLIMIT_FSIZE, limits.file_bytes) &&
         limit(RLIMIT_NOFILE, 64) &&
         limit(RLIMIT_CPU, static_cast<std::uint64_t>(std::ceil(std::min(limits.cpu_s, 1e6))) + 1);
}

}  // namespace brume
