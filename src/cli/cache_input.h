// Cache files as arguments of verbs that need no scene: convert, filter, diff.
#pragma once

#include <filesystem>
#include <string>

#include "cache/cache_file.h"
#include "cli/statistics.h"

namespace brume {

// What a complete cache holds. Throws Error(InvalidInput) with state and reason for any other.
CacheContents read_cache_contents(const std::filesystem::path& file);

// Settings are a person's JSON text; one that does not parse is still shown.
Json settings_json(const std::string& text);

// 16 hexadecimal digits.
std::string shown_key(std::uint64_t key);

}  // namespace brume
