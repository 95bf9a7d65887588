// The JavaScript that draws the charts of a page: Chart.js, as Debian packages it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace brume {

// Where libjs-chart.js and its kin put it.
std::vector<std::filesystem::path> chart_library_folders();

// The library's text, safe to stand inside of a <script> element, from the first folder that has
// it. Throws Error(Resource) naming the package where none does.
std::string load_chart_library(const std::vector<std::filesystem::path>& folders);

}  // namespace brume
