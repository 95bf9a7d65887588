// What a .vdb file holds, and what brume would make of it.
#pragma once

#include <filesystem>

#include "cli/command.h"
#include "vdb_media/grid_file.h"

namespace brume {

// As a table, or with --json as one object.
void inspect_grids(const std::filesystem::path& file, const GridFileOptions& options,
                   const CommandContext& context);

}  // namespace brume
