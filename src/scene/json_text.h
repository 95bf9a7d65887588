// JSON as people write it for us: `//` comments and a byte order mark are fine, everything that is
// doubtful is refused (duplicate keys, broken UTF-8, numbers beyond double, bottomless nesting).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace brume {

// Deeper nesting than this is refused. The scene format needs 6.
inline constexpr int kMaxJsonDepth = 64;

// Throws Error(InvalidInput): `FILE: line L, column C: ...`, or with a JSON pointer where the fault
// is a value's. `file` is only named, never opened.
nlohmann::json parse_json_text(std::string_view text, const std::string& file);

// `/a/b` + `x/y` = `/a/b/x~1y`.
std::string child_pointer(const std::string& pointer, std::string_view key);
std::string child_pointer(const std::string& pointer, std::size_t index);

// A value as messages show it: short, printable, one line.
std::string shown(const nlohmann::json& value);

}  // namespace brume
