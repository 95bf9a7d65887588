// A second copy of this program, started to do one thing under limits, and watched by the clock.
//
// The child is exec'ed, not merely forked: a fork of a process with threads may deadlock, and a
// fresh image holds none of the parent's memory. Parent and child talk through two memory files:
// the request at kRequestFd, the result at kResultFd.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

#include "unique_fd.h"

namespace brume {

inline constexpr int kRequestFd = 3;
inline constexpr int kResultFd = 4;

// An empty file in memory, closed on exec and above the standard descriptors (which a caller may
// have closed). Throws Error(Resource).
UniqueFd make_memory_file(const char* name);

// Forbids every further change, so that the bytes may be mapped and trusted to stay. Returns false
// where the system will not.
bool seal_memory_file(int fd);

struct ChildOutcome {
  enum class Ending { Exited, Signalled, TimedOut };
  Ending ending = Ending::Exited;
  int code = 0;         // Exit status, or the signal's number.
  std::string message;  // The last line that the child wrote to its standard error, bounded.
};

// Starts /proc/self/exe with `argument` and this process's id as its only arguments, and waits.
// A child that outlives `timeout_s` is killed. Its standard error is read and never passed on.
// Throws Error(Resource) where it could not be started or waited for.
ChildOutcome run_child_of_self(const std::string& argument, int request_fd, int result_fd,
                               double timeout_s);

// Half of what this machine, this process's cgroup and its own limits allow.
std::uint64_t default_memory_limit();

struct ChildLimits {
  std::uint64_t memory_bytes = 0;  // Of address space, on top of what the program itself maps.
  double cpu_s = 60;
  std::uint64_t file_bytes = 0;  // Size of any file written, the result included.
};

// The child's side: dies with its parent, leaves no core file, gains no privileges. Returns false
// if the parent is gone already.
bool bind_to_parent(pid_t parent);
// Returns false where the system refuses a limit: then nothing may be parsed.
bool apply_limits(const ChildLimits& limits);

}  // namespace brume
