// The whole program behind main(): parses the command line, runs a verb, and turns whatever went
// wrong into one line and an exit code (SPEC, "Command line").
#pragma once

#include <ostream>
#include <string>
#include <vector>

namespace brume {

// `arguments` without the program's name. Results go to `out`, everything else to `err`. The
// process must have been set up as tools/brume does: standard streams open, SIGPIPE ignored,
// denormals flushed.
int run(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err);

}  // namespace brume
