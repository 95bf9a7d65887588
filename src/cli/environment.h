// Settings from the environment: --step-voxels is BRUME_STEP_VOXELS. A flag wins over its variable,
// a variable over the scene file.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "cli/command.h"

namespace brume {

// BRUME_ and the option's long name in capitals, with underscores.
std::string environment_name(const CLI::Option& option);

// Lets a variable set `option` of `app`. Returns the option.
CLI::Option* with_environment(CommandContext& context, CLI::App& app, CLI::Option* option);

// After parsing: fills those options of the verbs in use that no flag has set. Throws Error(Usage)
// naming the variable. Warns of BRUME_* variables that nothing reads.
void apply_environment(CommandContext& context);

}  // namespace brume
