// What may go wrong, by kind. Libraries throw Error; only cli/ catches it and turns the kind into an
// exit code (SPEC, exit codes).
#pragma once

#include <stdexcept>
#include <string>

namespace brume {

enum class ErrorKind {
  Internal,      // exit 1: our own bug
  Usage,         // exit 2
  InvalidInput,  // exit 3: bad input, or over a limit
  Partial,       // exit 4: some frames failed
  Threshold,     // exit 5: a comparison over its threshold
  Resource,      // exit 6: out of memory or disk, cannot write
  Stopped,       // exit 75: stopped early with a valid checkpoint
};

int exit_code(ErrorKind kind);

// `message` reads `FILE: /json/pointer or grid: what is wrong: what to do`, in one line.
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message) : std::runtime_error(message), kind_(kind) {}
  ErrorKind kind() const { return kind_; }

 private:
  ErrorKind kind_;
};

[[noreturn]] void assertion_failed(const char* expression, const char* file, int line,
                                   const std::string& operands);

// Control characters of foreign text made visible, and its length bounded, before it is shown.
std::string printable(const std::string& text, std::size_t max_length = 200);

}  // namespace brume

// Our own bugs. On in every build: it guards invariants, never inner loops.
#define BRUME_ASSERT(a, op, b)                                                             \
  do {                                                                                     \
    if (!((a)op(b)))                                                                       \
      ::brume::assertion_failed(#a " " #op " " #b, __FILE__, __LINE__,                     \
                                std::to_string(a) + " vs " + std::to_string(b));           \
  } while (false)
