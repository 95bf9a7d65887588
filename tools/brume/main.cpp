// The brume program: sets up the process, then hands over to src/cli.
#include <fcntl.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <new>
#include <string>
#include <vector>

#include "cli/run.h"
#include "core/error.h"
#include "core/parallel.h"
#include "vdb_media/grid_file.h"

namespace {

// Without this, the first file opened would become standard output or error where a farm started us
// with these closed, and messages would be written into it.
void open_standard_streams() {
  int fd = open("/dev/null", O_RDWR);
  while (fd >= 0 && fd <= STDERR_FILENO) fd = open("/dev/null", O_RDWR);
  if (fd >= 0) close(fd);
}

// Memory may run out where nobody can catch it: in a library's thread, or in a destructor.
[[noreturn]] void end_without_catcher() {
  try {
    if (const std::exception_ptr thrown = std::current_exception()) std::rethrow_exception(thrown);
  } catch (const std::bad_alloc&) {
    constexpr char kMessage[] = "error: out of memory: use a smaller --res or scene\n";
    [[maybe_unused]] const ssize_t ignored = write(STDERR_FILENO, kMessage, sizeof kMessage - 1);
    _exit(brume::exit_code(brume::ErrorKind::Resource));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: internal error: %s\n", error.what());
  } catch (...) {
  }
  std::abort();
}

}  // namespace

int main(int argc, char** argv) {
  open_standard_streams();
  std::set_terminate(end_without_catcher);
  // A reader that went away is a failed write, which has an exit code of its own.
  std::signal(SIGPIPE, SIG_IGN);
  // So is a file that reached the size a limit allows.
  std::signal(SIGXFSZ, SIG_IGN);
  // Before any thread starts: the loader's child is this binary, and has nothing else to set up.
  if (const auto status = brume::run_grid_loader_child(argc, argv)) return *status;
  brume::flush_denormals();
  return brume::run({argv + (argc > 0 ? 1 : 0), argv + argc}, std::cout, std::cerr);
}
