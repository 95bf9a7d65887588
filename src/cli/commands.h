// The verbs that this folder's own files implement. Each adds its subcommand, whose action lands in
// the context when it is the one parsed.
#pragma once

#include <CLI/CLI.hpp>

#include "cli/command.h"

namespace brume {

void add_render_command(CLI::App& app, CommandContext& context);
void add_bake_command(CLI::App& app, CommandContext& context);
void add_merge_command(CLI::App& app, CommandContext& context);
void add_inspect_command(CLI::App& app, CommandContext& context);
void add_probe_command(CLI::App& app, CommandContext& context);
void add_figures_command(CLI::App& app, CommandContext& context);
void add_verify_command(CLI::App& app, CommandContext& context);
void add_filter_command(CLI::App& app, CommandContext& context);
void add_convert_command(CLI::App& app, CommandContext& context);
void add_flicker_command(CLI::App& app, CommandContext& context);

}  // namespace brume
