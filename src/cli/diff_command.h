// `diff A B`: how far image A is from the reference B.
#pragma once

#include "cli/command.h"

namespace brume {

void add_diff_command(CLI::App& app, CommandContext& context);

}  // namespace brume
