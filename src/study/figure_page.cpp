#include "study/figure_page.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>

#include "core/error.h"
#include "core/staged_file.h"
#include "render/false_colour.h"
#include "study/figure_charts.h"
#include "study/figure_images.h"
#include "study/figure_page_text.h"

namespace brume {
namespace {

using Json = nlohmann::ordered_json;

std::string base64(const std::string& bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k)
      word = word << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      out += i + k <= bytes.size() ? kDigits[word >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  if (bytes.empty())
    throw Error(ErrorKind::Resource, printable(file.string()) + ": cannot be read back");
  return bytes;
}

std::string percent(double part) { return short_number(100 * part) + " %"; }

std::string cells_text(const GatherOptions& gather) {
  return std::to_string(gather.cells_theta) + "x" + std::to_string(gather.cells_phi);
}

std::string table(const std::vector<std::string>& head,
                  const std::vector<std::vector<std::string>>& rows) {
  std::string out = "<div class=\"scroll\"><table><thead><tr>";
  for (const std::string& cell : head) out += "<th>" + cell + "</th>";
  out += "</tr></thead><tbody>";
  for (const auto& row : rows) {
    out += "<tr>";
    // A leading * marks the best of its row.
    for (const std::string& cell : row)
      out += cell.rfind('*', 0) == 0 ? "<td class=\"best\">" + cell.substr(1) + "</td>"
                                     : "<td>" + cell + "</td>";
    out += "</tr>";
  }
  return out + "</tbody></table></div>\n";
}

std::string colour_bar(const FigureRow& row) {
  std::string stops;
  for (int i = 0; i <= 16; ++i) {
    const auto c = map_colour(ColourMap::Diverging, i / 16.0);
    char text[40];
    std::snprintf(text, sizeof text, "%s#%02x%02x%02x", i == 0 ? "" : ",", c[0], c[1], c[2]);
    stops += text;
  }
  return "<span class=\"bar\">" + percent(row.low) +
         "<i style=\"background:linear-gradient(90deg," + stops + ")\"></i>" + percent(row.high) +
         "</span>";
}

std::string row_html(const FigureRow& row, bool are_maps) {
  std::string out = "<h3>" + row.heading + "</h3>\n<div class=\"scale\">" + row.scale +
                    (row.is_diverging ? " " + colour_bar(row) : "") + "</div>\n<div class=\"row " +
                    (are_maps ? "maps" : "frames") +
                    (row.images.size() == 2 && are_maps ? " pair" : "") + "\">\n";
  for (const FigureImage& image : row.images)
    out += "<figure><img alt=\"" + image.title + "\" src=\"data:image/png;base64," +
           base64(bytes_of(image.file)) + "\"><figcaption>" + image.title + "<small>" +
           image.numbers + "</small></figcaption></figure>\n";
  return out + "</div>\n";
}

std::string chart_html(const Json& chart) {
  return "<div class=\"chart\"><canvas id=\"" + chart.at("id").get<std::string>() +
         "\"></canvas></div>\n";
}

// A row of the table of interpolation; the best mode is marked.
std::vector<std::string> interpolation_row(const FigureScene& scene,
                                           const InterpolationErrors& errors) {
  std::vector<std::string> cells{scene_text_of(scene.name).title, std::to_string(errors.records),
                                 std::to_string(errors.points),
                                 percent(scene.interpolation.media_share)};
  const auto best = std::min_element(errors.relmse.begin(), errors.relmse.end());
  for (const double& v : errors.relmse)
    cells.push_back((&v == &*best ? "*" : "") + short_number(v));
  cells.push_back(percent(scene.interpolation.reference_noise));
  return cells;
}

class Page {
 public:
  Page(const FiguresReport& report, const std::filesystem::path& folder)
      : report_(report), folder_(folder) {}

  std::string html(const std::string& chart_library);

 private:
  std::string header() const;
  std::string summary();
  std::string interpolation(const std::string& id, const std::string& title,
                            InterpolationErrors InterpolationStudy::*which);
  std::string scene(const FigureScene& scene);
  std::string ground(const FigureScene& scene);
  std::string result(const FigureScene& scene) const;

  const FiguresReport& report_;
  const std::filesystem::path& folder_;
  Json charts_ = Json::array();
};

std::string Page::header() const {
  std::string nav = "<a href=\"#summary\">All scenes</a>";
  for (const FigureScene& s : report_.scenes)
    nav += "<a href=\"#" + s.name + "\">" + scene_text_of(s.name).title + "</a>";
  return std::string("<header><div><h1>Irradiance gradients in participating media</h1>") +
         kPageIntroduction + "<nav>" + nav + "</nav></div></header>\n";
}

std::string Page::interpolation(const std::string& id, const std::string& title,
                                InterpolationErrors InterpolationStudy::*which) {
  std::vector<std::vector<std::string>> rows;
  for (const FigureScene& s : report_.scenes)
    rows.push_back(interpolation_row(s, s.interpolation.*which));
  const Json chart = interpolation_chart(id, title, report_.scenes, which);
  charts_.push_back(chart);
  return table({"scene", "records", "points", "light from<br>the medium", "none", "Ward-Heckbert",
                "media", "full (ours)", "error of<br>the reference"},
               rows) +
         "<div class=\"charts wide\">" + chart_html(chart) + "</div>";
}

std::string Page::summary() {
  std::vector<std::vector<std::string>> times;
  for (const FigureScene& s : report_.scenes) {
    const PairedCost& cost = s.cost;
    times.push_back(
        {scene_text_of(s.name).title, std::to_string(s.width) + "x" + std::to_string(s.height),
         cells_text(s.settings.gather), short_number(s.bake_cpu), short_number(cost.ms_first),
         short_number(cost.ms_second),
         short_number(100 * (cost.ratio - 1)) + " (" + short_number(100 * (cost.low - 1)) + " to " +
             short_number(100 * (cost.high - 1)) + ")",
         s.result ? short_number(s.result->frames[0].render_cpu) : "",
         s.result ? short_number(s.result->path_cpu) : "",
         s.result ? std::to_string(s.result->path_samples) : ""});
  }
  return "<section id=\"summary\"><h2>All scenes</h2>\n" + std::string(kPageInterpolation) +
         interpolation("interpolation", "All records as baked", &InterpolationStudy::as_baked) +
         kPageSparseInterpolation +
         interpolation("sparse-interpolation", "A quarter of the records, twice the radius",
                       &InterpolationStudy::sparse) +
         "<h3>Times</h3><p>CPU seconds of this run. What gradients cost is measured on the same "
         "records in pairs, gather by gather in turn: the median of " +
         std::to_string(kCostPairs) + " pairs, and its 96.5 % interval.</p>" +
         table({"scene", "view", "cells", "bake<br>CPU s", "gather, full<br>ms",
                "gather, W-H<br>ms", "full over W-H<br>%", "frame<br>CPU s", "path tracer<br>CPU s",
                "its samples<br>a pixel"},
               times) +
         "<p class=\"note\">" + (report_.is_quick ? "A quick run: small, coarse and noisy. " : "") +
         "The whole page took " + short_number(report_.cpu_seconds) +
         " CPU seconds.</p></section>\n";
}

std::string Page::ground(const FigureScene& s) {
  const GroundStudy& g = *s.ground;
  std::string out;
  for (const FigureRow& row : write_ground_images(s, folder_)) out += row_html(row, true);
  out += "<p class=\"note\">Gradients from gathers of " + cells_text(g.gather) +
         " cells. Finite differences are central over a pixel, with the same random numbers at "
         "both ends: four "
         "gathers a pixel, of as many cells each (1x) or ten times as many (10x). Converged "
         "irradiance is "
         "the mean of two gathers of " +
         cells_text(g.reference) + " cells a pixel.</p>";
  const Json line = line_chart(s);
  charts_.push_back(line);
  out += "<div class=\"charts wide\">" + chart_html(line) +
         "</div><p class=\"note\">The truth is a central difference over a pixel of gathers with "
         "many more cells "
         "and shared random numbers, averaged over independent seeds, whose spread gives its "
         "standard error: " +
         percent(g.line.truth_relative_error) +
         " of the rms gradient. Doubling the step changes it by " + percent(g.line.step_effect) +
         ".</p>";
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < kSourceCount; ++i)
    rows.push_back({gradient_source_name(kGradientSources[i]), percent(g.line.relative_error[i]),
                    short_number(g.ms_per_pixel[i])});
  out += table({"gradient along the line", "rms error", "CPU ms a point"}, rows);
  out += "<div class=\"charts\">";
  for (const Json& chart : convergence_charts(s)) {
    charts_.push_back(chart);
    out += chart_html(chart);
  }
  return out +
         "</div><p class=\"note\">Error of extrapolated irradiance, rms over the ground and over "
         "independent sets of records. The radius of a record follows the spacing.</p>";
}

std::string Page::result(const FigureScene& s) const {
  std::string out;
  for (const FigureRow& row : write_result_images(s, folder_)) out += row_html(row, false);
  return out + "<p class=\"note\">" + std::to_string(s.interpolation.as_baked.records) +
         " records at the same places with the same radii and irradiance. Errors are of blocks of "
         "pixels; the "
         "reference is path-traced with exactly the paths that the cached frames hold, and its "
         "blocks have a "
         "standard error of " +
         percent(s.result->reference_noise) + " of the mean.</p>";
}

std::string Page::scene(const FigureScene& s) {
  const SceneText text = scene_text_of(s.name);
  std::string out = "<section id=\"" + s.name + "\"><h2>" + text.title + "</h2><p>" +
                    text.description + "</p><p>" + text.shows +
                    "</p>\n<p class=\"note\">Scene file: <code>scenes/" + s.name + "/" +
                    s.file.filename().string() + "</code></p>\n";
  out += s.ground ? ground(s) : result(s);
  return out + "</section>\n";
}

std::string Page::html(const std::string& chart_library) {
  std::string body = header() + "<main>\n" + summary();
  for (const FigureScene& s : report_.scenes) body += scene(s);
  // JSON inside of <script> must not close it.
  std::string charts = charts_.dump();
  for (std::size_t at = charts.find("</"); at != std::string::npos; at = charts.find("</", at + 3))
    charts.replace(at, 2, "<\\/");
  return std::string(
             "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
             "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
             "<title>brume: figures</title><link rel=\"icon\" href=\"data:,\"><style>") +
         kPageStyle + "</style></head>\n<body>\n" + body + "</main>\n<script>\n" + chart_library +
         "\n</script>\n<script type=\"application/json\" id=\"charts\">" + charts +
         "</script>\n<script>" + kPageScript + "</script>\n</body></html>\n";
}

Json by_mode(const std::array<double, kModeCount>& values) {
  Json all = Json::object();
  for (std::size_t m = 0; m < kModeCount; ++m)
    all[gradient_mode_name(kGradientModes[m])] = values[m];
  return all;
}

Json interpolation_json(const InterpolationStudy& study) {
  Json all{{"media_share", study.media_share}, {"reference_noise", study.reference_noise}};
  const auto add = [&](const char* name, const InterpolationErrors& errors) {
    all[name] = {{"records", errors.records},
                 {"points", errors.points},
                 {"relmse", by_mode(errors.relmse)},
                 {"relative_rms", by_mode(errors.relative_rms)}};
  };
  add("as_baked", study.as_baked);
  add("sparse", study.sparse);
  return all;
}

Json convergence_json(const std::vector<ConvergencePoint>& points) {
  Json all = Json::array();
  for (const ConvergencePoint& p : points)
    all.push_back(
        {{"along", p.along}, {"count", p.count}, {"relative_rms", by_mode(p.relative_rms)}});
  return all;
}

Json ground_json(const GroundStudy& g) {
  Json line{{"truth_relative_error", g.line.truth_relative_error},
            {"step_effect", g.line.step_effect},
            {"x", g.line.x},
            {"truth", g.line.truth},
            {"truth_error", g.line.truth_error}};
  Json errors = Json::object();
  for (std::size_t s = 0; s < kSourceCount; ++s)
    errors[gradient_source_key(kGradientSources[s])] = g.line.relative_error[s];
  line["relative_error"] = errors;
  std::array<double, kModeCount> extrapolation{};
  for (std::size_t m = 0; m < kModeCount; ++m) extrapolation[m] = g.extrapolation[m].relative_rms;
  return {{"pixels", g.pixels},
          {"media_share", g.media_share},
          {"reference_noise", g.reference_noise},
          {"line", line},
          {"extrapolation_relative_rms", by_mode(extrapolation)},
          {"by_cells", convergence_json(g.by_cells)},
          {"by_records", convergence_json(g.by_records)}};
}

Json result_json(const ResultStudy& r) {
  Json frames = Json::object();
  for (std::size_t m = 0; m < kResultModes.size(); ++m)
    frames[gradient_mode_name(kResultModes[m])] = {{"relative_rms", r.frames[m].relative_rms},
                                                   {"signed_mean", r.frames[m].signed_mean},
                                                   {"cpu_seconds", r.frames[m].render_cpu}};
  return {{"resolution", {r.width, r.height}},
          {"frames", frames},
          {"path",
           {{"samples", r.path_samples},
            {"cpu_seconds", r.path_cpu},
            {"reference_noise", r.reference_noise}}}};
}

}  // namespace

Json figures_json(const FiguresReport& report) {
  Json scenes = Json::array();
  for (const FigureScene& s : report.scenes) {
    Json scene{{"name", s.name},
               {"interpolation", interpolation_json(s.interpolation)},
               {"regather_change", s.regather_change},
               {"bake_cpu_seconds", s.bake_cpu},
               {"cost",
                {{"ratio", s.cost.ratio},
                 {"interval", {s.cost.low, s.cost.high}},
                 {"pairs", s.cost.pairs},
                 {"gathers", s.cost.gathers}}}};
    if (s.ground) scene["ground"] = ground_json(*s.ground);
    if (s.result) scene["result"] = result_json(*s.result);
    scenes.push_back(scene);
  }
  return {{"quick", report.is_quick}, {"cpu_seconds", report.cpu_seconds}, {"scenes", scenes}};
}

void write_figures(const FiguresReport& report, const std::filesystem::path& folder,
                   const std::string& chart_library) {
  const std::string html = Page(report, folder).html(chart_library);
  write_file_whole(folder / "figures.json", figures_json(report).dump(2) + "\n");
  write_file_whole(folder / "index.html", html);
}

}  // namespace brume
