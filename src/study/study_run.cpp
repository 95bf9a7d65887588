#include "study/study_run.h"

#include <atomic>
#include <ctime>

#include "core/error.h"
#include "core/parallel.h"

namespace brume {

namespace {

double clock_seconds(clockid_t clock) {
  timespec t{};
  clock_gettime(clock, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

}  // namespace

void StudyRun::check_stop() const {
  if (stop_requested && stop_requested()) throw Error(ErrorKind::Stopped, "stopped before its end");
}

void StudyRun::each(const std::string& stage, std::size_t count,
                    const std::function<void(std::size_t, int)>& body) const {
  std::atomic<std::size_t> done = 0;
  parallel_for_slots(threads, count, 1, [&](std::size_t i, int slot) {
    if (stop_requested && stop_requested()) return;
    body(i, slot);
    if (progress) progress(stage, double(++done) / double(count));
  });
  check_stop();
}

double process_cpu_seconds() { return clock_seconds(CLOCK_PROCESS_CPUTIME_ID); }
double thread_cpu_seconds() { return clock_seconds(CLOCK_THREAD_CPUTIME_ID); }

}  // namespace brume
