#include "cli/text_table.h"

#include <algorithm>
#include <cstdio>

namespace brume {

std::string shown_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

void print_table(std::ostream& out, const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> width;
  for (const auto& row : rows)
    for (std::size_t c = 0; c < row.size(); ++c) {
      if (width.size() <= c) width.push_back(0);
      width[c] = std::max(width[c], row[c].size());
    }
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t c = 0; c < row.size(); ++c) {
      const std::string padding(width[c] - row[c].size(), ' ');
      line += (c > 0 ? "  " : "") + (c == 0 ? row[c] + padding : padding + row[c]);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    out << line << '\n';
  }
}

Json json_of(const Vec3d& v) { return Json::array({v.x, v.y, v.z}); }
Json json_of(const RgbD& c) { return Json::array({c.r, c.g, c.b}); }
Json json_of(const RgbGradient& g) {
  return Json::array({json_of(g.r), json_of(g.g), json_of(g.b)});
}

}  // namespace brume
