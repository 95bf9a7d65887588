#include "core/parallel.h"

#include <sched.h>
#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <xmmintrin.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <thread>

namespace brume {
namespace {

std::atomic<int> g_thread_limit = 0;

constexpr unsigned kFlushToZero = 0x8000, kDenormalsAreZero = 0x0040;

}  // namespace

void flush_denormals() { _mm_setcsr(_mm_getcsr() | kFlushToZero | kDenormalsAreZero); }

bool denormals_are_flushed() {
  constexpr unsigned both = kFlushToZero | kDenormalsAreZero;
  return (_mm_getcsr() & both) == both;
}

DenormalsKept::DenormalsKept() : were_flushed_(denormals_are_flushed()) {
  _mm_setcsr(_mm_getcsr() & ~(kFlushToZero | kDenormalsAreZero));
}
DenormalsKept::~DenormalsKept() {
  if (were_flushed_) flush_denormals();
}

ThreadLimit::ThreadLimit(int threads) : before_(g_thread_limit) {
  if (threads > 0) g_thread_limit = threads;
}
ThreadLimit::~ThreadLimit() { g_thread_limit = before_; }

int resolve_thread_count(int requested) {
  if (requested > 0) return requested;
  if (g_thread_limit > 0) return g_thread_limit;
  if (const char* slurm = std::getenv("SLURM_CPUS_PER_TASK")) {
    const int n = std::atoi(slurm);
    if (n > 0) return n;
  }
  cpu_set_t set;
  if (sched_getaffinity(0, sizeof set, &set) == 0) return std::max(1, CPU_COUNT(&set));
  return std::max(1u, std::thread::hardware_concurrency());
}

void parallel_for_slots(int threads, std::size_t count, std::size_t grain,
                        const std::function<void(std::size_t, int)>& body) {
  if (count == 0) return;
  const int n = resolve_thread_count(threads);
  if (n == 1) {
    flush_denormals();
    for (std::size_t i = 0; i < count; ++i) body(i, 0);
    return;
  }
  // Without it TBB caps an arena at the machine's cores, and says so on standard error.
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(n));
  tbb::task_arena arena(n);
  arena.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, count, std::max<std::size_t>(1, grain)),
        [&](const tbb::blocked_range<std::size_t>& range) {
          flush_denormals();
          const int slot = tbb::this_task_arena::current_thread_index();
          for (std::size_t i = range.begin(); i < range.end(); ++i) body(i, slot);
        },
        tbb::simple_partitioner());
  });
}

void parallel_for(int threads, std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t)>& body) {
  parallel_for_slots(threads, count, grain, [&](std::size_t i, int) { body(i); });
}

}  // namespace brume
