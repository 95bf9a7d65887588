#include "study/chart_library.h"

#include <fstream>
#include <iterator>

#include "core/error.h"

namespace brume {

std::vector<std::filesystem::path> chart_library_folders() {
  return {"/usr/share/javascript/chart.js", "/usr/share/nodejs/chart.js/dist"};
}

std::string load_chart_library(const std::vector<std::filesystem::path>& folders) {
  for (const std::filesystem::path& folder : folders)
    for (const char* name : {"chart.min.js", "Chart.min.js", "chart.umd.js", "chart.js"}) {
      std::ifstream file(folder / name, std::ios::binary);
      std::string text{std::istreambuf_iterator<char>(file), {}};
      // A text that could end its own element would break the page.
      if (!text.empty() && text.find("</script") == std::string::npos) return text;
    }
  throw Error(ErrorKind::Resource,
              "Chart.js: not found where Debian puts it: install the package libjs-chart.js");
}

}  // namespace brume
