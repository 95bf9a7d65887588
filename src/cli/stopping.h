// How a run that was asked to stop ends (SPEC, exit codes).
#pragma once

#include <filesystem>
#include <string>

#include "cli/command.h"

namespace brume {

// Throws Error(Stopped), exit 75, where `checkpoint` names a valid file that the same command
// resumes from; else says so and returns 128 + signal.
int end_stopped_run(const CommandContext& context, int signal,
                    const std::filesystem::path& checkpoint);

// The same for a run that reached its time or record limit, as `reason` says.
[[noreturn]] void end_run_at_limit(const std::string& reason,
                                   const std::filesystem::path& checkpoint);

}  // namespace brume
