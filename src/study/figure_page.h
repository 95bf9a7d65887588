// The figures as one page that needs nothing else, as PNG files, and as JSON.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "study/figures.h"

namespace brume {

// All numbers of the report; maps are left to the pictures.
nlohmann::ordered_json figures_json(const FiguresReport& report);

// Writes the PNG files, figures.json and, last, index.html into `folder`. Pictures and
// `chart_library` (chart_library.h) are part of the page, so that it needs no network and no other
// file.
void write_figures(const FiguresReport& report, const std::filesystem::path& folder,
                   const std::string& chart_library);

}  // namespace brume
