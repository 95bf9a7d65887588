// What long studies share: threads, how far they are, and being asked to stop.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

namespace brume {

struct StudyRun {
  int threads = 0;
  // Stage and fraction of it, rising; from any thread.
  std::function<void(const std::string& stage, double fraction)> progress{};
  std::function<bool()> stop_requested{};

  // body(index, slot) for each index on `threads` threads, an index at a time (core/parallel.h).
  // Throws Error(Stopped) where a stop is asked for.
  void each(const std::string& stage, std::size_t count,
            const std::function<void(std::size_t index, int slot)>& body) const;
  void check_stop() const;
};

// CPU time of the whole process, and of the thread that asks.
double process_cpu_seconds();
double thread_cpu_seconds();

}  // namespace brume
