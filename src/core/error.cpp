#include "core/error.h"

#include <cstdio>

namespace brume {

int exit_code(ErrorKind kind) {
  switch (kind) {
    case ErrorKind::Internal: return 1;
    case ErrorKind::Usage: return 2;
    case ErrorKind::InvalidInput: return 3;
    case ErrorKind::Partial: return 4;
    case ErrorKind::Threshold: return 5;
    case ErrorKind::Resource: return 6;
    case ErrorKind::Stopped: return 75;
  }
  return 1;
}

void assertion_failed(const char* expression, const char* file, int line,
                      const std::string& operands) {
  throw Error(ErrorKind::Internal, std::string(file) + ":" + std::to_string(line) +
                                       ": assertion failed: " + expression + " (" + operands + ")");
}

std::string printable(const std::string& text, std::size_t max_length) {
  std::string out;
  for (const char c : text) {
    if (out.size() >= max_length) return out + "...";
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte != 0x7f) {
      out += c;
    } else {
      char escaped[8];
      std::snprintf(escaped, sizeof escaped, "\\x%02x", byte);
      out += escaped;
    }
  }
  return out;
}

}  // namespace brume
