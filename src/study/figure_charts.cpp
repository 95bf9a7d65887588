#include "study/figure_charts.h"

#include "study/figure_images.h"

namespace brume {
namespace {

using Json = nlohmann::ordered_json;

// Told apart by colour-blind readers too (the palette of Okabe and Ito).
const char* mode_colour(GradientMode mode) {
  switch (mode) {
    case GradientMode::None:
      return "#8a8f98";
    case GradientMode::WardHeckbert:
      return "#009e73";
    case GradientMode::Media:
      return "#e69f00";
    case GradientMode::Full:
      break;
  }
  return "#0072b2";
}

Json points_of(const std::vector<double>& x, const std::vector<double>& y) {
  Json points = Json::array();
  for (std::size_t i = 0; i < x.size(); ++i) points.push_back({{"x", x[i]}, {"y", y[i]}});
  return points;
}

Json convergence_chart(const std::string& id, const std::string& title, const std::string& x,
                       const std::vector<ConvergencePoint>& points) {
  Json series = Json::array();
  for (std::size_t m = 0; m < kModeCount; ++m) {
    std::vector<double> counts, errors;
    for (const ConvergencePoint& p : points) {
      // Where the reference's noise hides all error there is nothing to draw on a logarithmic axis.
      if (!(p.relative_rms[m] > 0)) continue;
      counts.push_back(p.count);
      errors.push_back(100 * p.relative_rms[m]);
    }
    series.push_back({{"name", gradient_mode_name(kGradientModes[m])},
                      {"color", mode_colour(kGradientModes[m])},
                      {"points", 4},
                      {"data", points_of(counts, errors)}});
  }
  return {{"id", id},      {"kind", "line"}, {"title", title},
          {"x", x},        {"x_unit", ""},   {"y", "rms error of E over its mean"},
          {"y_unit", "%"}, {"log", true},    {"series", series}};
}

}  // namespace

Json line_chart(const FigureScene& scene) {
  const GradientLine& line = scene.ground->line;
  struct Style {
    GradientSource source;
    const char* color;
    Json dash;
  };
  const std::array styles{
      Style{GradientSource::Full, mode_colour(GradientMode::Full), Json::array()},
      Style{GradientSource::Media, mode_colour(GradientMode::Media), Json::array()},
      Style{GradientSource::WardHeckbert, mode_colour(GradientMode::WardHeckbert), Json::array()},
      Style{GradientSource::FineDifferences, "#cc79a7", {6, 4}},
      Style{GradientSource::Differences, "#e6bfd4", {2, 3}}};
  Json series = Json::array();
  series.push_back({{"name", "truth"},
                    {"color", "#111111"},
                    {"width", 3},
                    {"order", 1},
                    {"data", points_of(line.x, line.truth)}});
  for (std::size_t i = 0; i < styles.size(); ++i)
    series.push_back(
        {{"name", gradient_source_name(styles[i].source)},
         {"color", styles[i].color},
         {"dash", styles[i].dash},
         {"order", i < 3 ? 0 : 2},
         {"data", points_of(line.x, line.gradient[static_cast<std::size_t>(styles[i].source)])}});
  return {{"id", scene.name + "-line"},
          {"kind", "line"},
          {"title", "dE/dx along a line of the ground"},
          {"x", "x"},
          {"x_unit", "m"},
          {"y", "dE/dx"},
          {"y_unit", "W/m³"},
          {"log", false},
          {"series", series}};
}

std::vector<Json> convergence_charts(const FigureScene& scene) {
  return {convergence_chart(scene.name + "-cells", "More cells, same number of records",
                            "cells of a gather", scene.ground->by_cells),
          convergence_chart(scene.name + "-records", "More records, same number of cells",
                            "records", scene.ground->by_records)};
}

Json interpolation_chart(const std::string& id, const std::string& title,
                         const std::vector<FigureScene>& scenes,
                         InterpolationErrors InterpolationStudy::*which) {
  Json labels = Json::array(), series = Json::array();
  for (const FigureScene& scene : scenes) labels.push_back(scene.name);
  for (std::size_t m = 0; m < kModeCount; ++m) {
    Json data = Json::array();
    for (const FigureScene& scene : scenes) {
      const auto& relmse = (scene.interpolation.*which).relmse;
      data.push_back(relmse[0] > 0 ? relmse[m] / relmse[0] : 0);
    }
    series.push_back({{"name", gradient_mode_name(kGradientModes[m])},
                      {"color", mode_colour(kGradientModes[m])},
                      {"data", data}});
  }
  return {{"id", id},     {"kind", "bar"},    {"title", title},
          {"x", "scene"}, {"labels", labels}, {"y", "relMSE over that of none"},
          {"y_unit", ""}, {"log", false},     {"series", series}};
}

}  // namespace brume
