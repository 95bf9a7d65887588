#include "cli/command.h"

namespace brume {

void CommandContext::note(const std::string& line) const {
  if (verbosity >= 0) err << line << '\n';
}

void CommandContext::info(const std::string& line) const {
  if (verbosity >= 1) err << line << '\n';
}

void CommandContext::warn(const std::string& line) const {
  if (verbosity < 0) return;
  err << (color ? "\x1b[33mwarning:\x1b[0m " : "warning: ") << line << '\n';
}

}  // namespace brume
