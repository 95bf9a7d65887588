// What a file is, by its first bytes.
#pragma once

#include <filesystem>

namespace brume {

// Begins like an OpenVDB file. False for what cannot be opened or is no regular file.
bool has_grid_magic(const std::filesystem::path& file);

// Begins like an irradiance cache, complete or not.
bool has_cache_magic(const std::filesystem::path& file);

// Where a .vdb may stand for a scene or a cache: has_grid_magic(), or named *.vdb.
bool names_a_grid_file(const std::filesystem::path& file);

}  // namespace brume
