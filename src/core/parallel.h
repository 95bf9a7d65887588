// Parallel loops whose result cannot depend on the number of threads: an index owns its output.
#pragma once

#include <cstddef>
#include <functional>

namespace brume {

// Denormals cost up to 60 times the time and change bits between threads (HARD_CASES N08), so every
// task runs with flush-to-zero and denormals-are-zero. Main threads call this once at start.
void flush_denormals();
bool denormals_are_flushed();

// Denormals are numbers like others on this thread while it lives: for text that must hold every
// float there is.
class DenormalsKept {
 public:
  DenormalsKept();
  ~DenormalsKept();
  DenormalsKept(const DenormalsKept&) = delete;
  DenormalsKept& operator=(const DenormalsKept&) = delete;

 private:
  bool were_flushed_;
};

// While it lives, loops that ask for no number of threads have so many: those deep inside
// libraries, like the building of an index. For the program's main thread; 0 changes nothing.
class ThreadLimit {
 public:
  explicit ThreadLimit(int threads);
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

 private:
  int before_;
};

// 0 means the ThreadLimit, else SLURM_CPUS_PER_TASK, else the CPUs this process may run on.
int resolve_thread_count(int requested);

// Runs body(i) for i in [0, count) on `threads` threads (resolved as above), in any order.
// The first exception is rethrown here. `grain` indices go to a task at a time.
void parallel_for(int threads, std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t)>& body);

// Same, with a per-thread slot number in [0, resolve_thread_count(threads)) for scratch memory and
// counters. Nothing that reaches an output may depend on the slot.
void parallel_for_slots(int threads, std::size_t count, std::size_t grain,
                        const std::function<void(std::size_t index, int slot)>& body);

}  // namespace brume
