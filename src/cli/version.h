// Which brume this is, and which libraries it was built with.
#pragma once

#include <string>

namespace brume {

// "brume 0.1.0".
std::string program_version();
// program_version() and a line for each library.
std::string version_text();

}  // namespace brume
