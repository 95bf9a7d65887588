#include "cli/stopping.h"

#include "core/error.h"

namespace brume {

int end_stopped_run(const CommandContext& context, int signal,
                    const std::filesystem::path& checkpoint) {
  if (!checkpoint.empty())
    throw Error(ErrorKind::Stopped, printable(checkpoint.string()) + ": stopped by signal " +
                                        std::to_string(signal) +
                                        ": the same command goes on from here");
  context.err << "error: stopped by signal " << signal << ": nothing was written\n";
  return 128 + signal;
}

void end_run_at_limit(const std::string& reason, const std::filesystem::path& checkpoint) {
  throw Error(ErrorKind::Stopped, printable(checkpoint.string()) + ": stopped at " + reason +
                                      ": the same command with a higher one goes on from here");
}

}  // namespace brume
