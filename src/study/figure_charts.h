// What the page's script (figure_page_text.h) draws; private to study.
#pragma once

#include <nlohmann/json.hpp>

#include "study/figures.h"

namespace brume {

// Each has an "id" that is also that of its canvas.
nlohmann::ordered_json line_chart(const FigureScene& scene);
std::vector<nlohmann::ordered_json> convergence_charts(const FigureScene& scene);
nlohmann::ordered_json interpolation_chart(const std::string& id, const std::string& title,
                                           const std::vector<FigureScene>& scenes,
                                           InterpolationErrors InterpolationStudy::*which);

}  // namespace brume
