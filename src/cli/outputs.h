// Files that a verb will write: whether they can be, decided before any work begins (HARD_CASES
// T07).
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "cli/command.h"
#include "cli/statistics.h"

namespace brume {

enum class ExistingPolicy { Overwrite, Skip, Error };  // --existing

// Throws Error(Resource) unless `file` can be created or replaced. Creates and removes a file
// beside it.
void check_writable(const std::filesystem::path& file);

// Checks all of `files`, and what is there already against the policy. False: all exist and the
// policy is to skip them; said on `err`.
bool outputs_are_wanted(const std::vector<std::filesystem::path>& files, ExistingPolicy policy,
                        const CommandContext& context);

// `file` with a run of # replaced by the frame number, padded to the run's length. Throws
// Error(Usage) where there is a run of four or more and no frame.
std::filesystem::path with_frame(const std::filesystem::path& file,
                                 const std::optional<int>& frame);

// --json to `out`, --stats to its file.
void report_statistics(const CommandContext& context, const Statistics& statistics);

// One line and a newline on `out`, indented.
void print_json(const CommandContext& context, const Json& object);

}  // namespace brume
