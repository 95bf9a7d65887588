// Columns of text and numbers for people.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "cli/statistics.h"
#include "core/math.h"

namespace brume {

// Six significant digits.
std::string shown_number(double value);

// Prints rows with columns aligned: the first to the left, the others to the right. Rows may be
// short.
void print_table(std::ostream& out, const std::vector<std::vector<std::string>>& rows);

Json json_of(const Vec3d& v);
Json json_of(const RgbD& c);
// Three rows, one a channel.
Json json_of(const RgbGradient& g);

}  // namespace brume
