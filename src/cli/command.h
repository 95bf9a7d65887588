// What every verb shares: streams, the options that go with any verb, and how a verb is run.
#pragma once

#include <filesystem>
#include <functional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "vdb_media/grid_file.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace brume {

enum class ProgressStyle { Auto, Bar, Plain, None };

// Log lines go to `err`, results to `out`. Not thread-safe but for log().
struct CommandContext {
  std::ostream& out;
  std::ostream& err;
  std::vector<std::string> arguments;  // As given, for metadata.

  int verbosity = 0;              // -q is -1; -v, -vv.
  int threads = 0;                // -t; 0: resolved by core/parallel.h.
  std::function<int()> action{};  // Set by the verb that was parsed; returns the exit code.

  bool json = false;                   // --json: the result is one JSON object on `out`.
  std::filesystem::path stats_file{};  // --stats; empty: none.
  ProgressStyle progress = ProgressStyle::Auto;
  bool err_is_terminal = false;
  bool color = false;  // A terminal, and no NO_COLOR.
  // Options that a BRUME_* variable may set, with the verb they belong to (environment.h).
  std::vector<std::pair<CLI::App*, CLI::Option*>> environment_options{};

  void note(const std::string& line) const;  // At verbosity >= 0.
  void info(const std::string& line) const;  // At -v.
  void warn(const std::string& line) const;  // Always but with -q: `warning: line`.
};

}  // namespace brume
