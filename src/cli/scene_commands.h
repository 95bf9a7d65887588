// `brume scene check|info|schema`: scene files looked at, not rendered.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/command.h"

namespace brume {

void add_scene_commands(CLI::App& app, CommandContext& context);

}  // namespace brume
