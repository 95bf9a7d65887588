// What every verb shares: streams, the options that go with any verb, and how a verb is run.
#pragma once

#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "vdb_media/grid_file.h"

namespace brume {

// Log lines go to `err`, results to `out`. Not thread-safe but for log().
struct CommandContext {
  std::ostream& out;
  std::ostream& err;
  std::vector<std::string> arguments;  // As given, for metadata.

  int verbosity = 0;  // -q is -1; -v, -vv.
  int threads = 0;    // -t; 0: resolved by core/parallel.h.
  std::function<int()> action;  // Set by the verb that was parsed; returns the exit code.

  void note(const std::string& line) const;  // At verbosity >= 0.
  void info(const std::string& line) const;  // At -v.
  void warn(const std::string& line) const;  // Always but with -q: `warning: line`.
};

}  // namespace brume
