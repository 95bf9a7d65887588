// Opens files that a scene names: regular files only, never blocking on a pipe, and, when asked,
// only inside one folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace brume {

// All throw Error(InvalidInput) in the form `FILE: what: what to do`.

// Links and `..` resolved, then compared; a file that does not exist yet (an output) is judged by
// the part of its path that does.
void check_confined(const std::filesystem::path& file,
                    const std::optional<std::filesystem::path>& folder);

// Refuses what is missing, unreadable or no regular file; a FIFO does not block.
void check_regular_file(const std::filesystem::path& file);

std::string read_regular_file(const std::filesystem::path& file, std::uint64_t max_bytes);

}  // namespace brume
