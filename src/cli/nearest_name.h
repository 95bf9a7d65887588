// "Did you mean": the known name closest to a mistyped one.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace brume {

// Nothing where none is within a third of the name's length (at least 2) of edits, a swap of
// neighbours being one. The first of equals wins.
std::optional<std::string> nearest_name(const std::string& name,
                                        const std::vector<std::string>& known);

// " (did you mean 'X'?)", or "".
std::string hint_for(const std::string& name, const std::vector<std::string>& known);

}  // namespace brume
