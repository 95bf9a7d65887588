// The brume program: sets up the process, then hands over to src/cli.
#include <fcntl.h>
#include <unistd.h>

#include <csignal>
#include <iostream>
#include <string>
#include <vector>

#include "cli/run.h"
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

}  // namespace

int main(int argc, char** argv) {
  open_standard_streams();
  // A reader that went away is a failed write, which has an exit code of its own.
  std::signal(SIGPIPE, SIG_IGN);
  // Before any thread starts: the loader's child is this binary, and has nothing else to set up.
  if (const auto status = brume::run_grid_loader_child(argc, argv)) return *status;
  brume::flush_denormals();
  return brume::run({argv + (argc > 0 ? 1 : 0), argv + argc}, std::cout, std::cerr);
}
