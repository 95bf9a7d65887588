// How far a run has come, on standard error: a bar on a terminal, lines in a log.
//
// The fraction of a stage never falls, is never NaN, and reaches 100 % before the next stage
// begins.
#pragma once

#include <chrono>
#include <functional>
#include <mutex>
#include <ostream>
#include <string>

#include "cli/command.h"

namespace brume {

// Thread-safe.
class Progress {
 public:
  explicit Progress(const CommandContext& context);
  ~Progress();  // Leaves the line if a stage was cut short.
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void update(const std::string& stage, double fraction);
  // The stage under way is at 100 %.
  void finish();

  std::function<void(const std::string&, double)> callback();
  std::function<void(double)> callback(const std::string& stage);

 private:
  void show(bool last);
  void finish_locked();

  std::ostream& stream_;
  ProgressStyle style_;
  bool is_asked_for_;
  std::mutex mutex_;
  std::string stage_;
  double fraction_ = 0;
  int shown_percent_ = -1;
  bool is_line_open_ = false;
  std::chrono::steady_clock::time_point shown_at_;
};

}  // namespace brume
