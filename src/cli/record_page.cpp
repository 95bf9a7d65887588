#include "cli/record_page.h"

#include <cstring>
#include <fstream>
#include <set>

#include "cli/page_surfaces.h"
#include "cli/record_page_text.h"
#include "cli/statistics.h"
#include "core/error.h"
#include "core/staged_file.h"
#include "render/false_colour.h"

namespace brume {
namespace {

// Debian and Ubuntu put the classic script here.
constexpr const char* kThreePlaces[] = {"/usr/share/javascript/three/three.min.js",
                                        "/usr/share/nodejs/three/build/three.min.js"};
// Its licence asks for this wherever a copy goes.
constexpr const char* kThreeNotice =
    "three.js, https://threejs.org, Copyright (c) 2010 three.js authors. The MIT License:\n"
    "Permission is hereby granted, free of charge, to any person obtaining a copy of this software "
    "and associated documentation files (the \"Software\"), to deal in the Software without "
    "restriction, including without limitation the rights to use, copy, modify, merge, publish, "
    "distribute, sublicense, and/or sell copies of the Software, and to permit persons to whom the "
    "Software is furnished to do so, subject to the following conditions: The above copyright "
    "notice and this permission notice shall be included in all copies or substantial portions of "
    "the Software. THE SOFTWARE IS PROVIDED \"AS IS\", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR "
    "IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A "
    "PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE "
    "LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR "
    "OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER "
    "DEALINGS IN THE SOFTWARE.";

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

std::string read_three_js(const std::filesystem::path& chosen) {
  std::vector<std::filesystem::path> places{chosen};
  if (chosen.empty()) places.assign(std::begin(kThreePlaces), std::end(kThreePlaces));
  for (const std::filesystem::path& place : places) {
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(place, ignored)) continue;
    std::ifstream stream(place, std::ios::binary);
    std::string text(std::istreambuf_iterator<char>(stream), {});
    // The end of the element would be taken for such, even inside the script's strings.
    for (std::size_t at = text.find("</script"); at != std::string::npos;
         at = text.find("</script", at))
      text.replace(at, 2, "<\\/");
    return text;
  }
  throw Error(ErrorKind::InvalidInput,
              printable(places.front().string()) +
                  ": three.js is not there: install the package libjs-three, or name its "
                  "three.min.js with --three-js");
}

std::string base64(const void* data, std::size_t size) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const auto* bytes = static_cast<const unsigned char*>(data);
  std::string text;
  text.reserve((size + 2) / 3 * 4);
  for (std::size_t i = 0; i < size; i += 3) {
    const unsigned word = bytes[i] << 16u | (i + 1 < size ? bytes[i + 1] << 8u : 0u) |
                          (i + 2 < size ? bytes[i + 2] : 0u);
    text += kDigits[word >> 18 & 63];
    text += kDigits[word >> 12 & 63];
    text += i + 1 < size ? kDigits[word >> 6 & 63] : '=';
    text += i + 2 < size ? kDigits[word & 63] : '=';
  }
  return text;
}
template <typename T>
std::string base64(const std::vector<T>& values) {
  return base64(values.data(), values.size() * sizeof(T));
}

// A row as record_page/data_view.js reads it.
void append_row(std::vector<float>& rows, const SurfaceRecord& r, const Vec3d& local_to_page) {
  const auto add = [&](const Vec3d& v) {
    for (int a = 0; a < 3; ++a) rows.push_back(static_cast<float>(v[a]));
  };
  const Vec3d n = vector(r.normal).normalized();
  const Frame frame(n);
  add(vector(r.position) + local_to_page);
  add(n);
  add(frame.u * std::cos(double(r.axis)) + frame.v * std::sin(double(r.axis)));
  add(vector(r.irradiance));
  for (int c = 0; c < 3; ++c) add(vector(r.gradient + 3 * c));
  rows.push_back(r.radius[0]);
  rows.push_back(r.radius[1]);
  rows.push_back(r.error);
  rows.push_back(r.media_share);
  rows.push_back(static_cast<float>(r.layer()));
  rows.push_back(static_cast<float>(r.wave()));
  const Vec3d g =
      luminance(RgbGradient{vector(r.gradient), vector(r.gradient + 3), vector(r.gradient + 6)});
  add(g - n * g.dot(n));
}

Json record_data(const CacheContents& contents, const std::vector<std::size_t>& chosen,
                 const Vec3d& centre) {
  std::vector<float> rows;
  std::vector<std::uint32_t> keys, indices;
  std::set<int> layers;
  for (const std::size_t i : chosen) {
    const SurfaceRecord& r = contents.records[i];
    append_row(rows, r, contents.header.origin - centre);
    keys.push_back(static_cast<std::uint32_t>(r.key));
    keys.push_back(static_cast<std::uint32_t>(r.key >> 32));
    indices.push_back(static_cast<std::uint32_t>(i));
    layers.insert(r.layer());
  }
  Json object = Json::object();
  object["total"] = contents.records.size();
  object["records"] = base64(rows);
  object["keys"] = base64(keys);
  object["indices"] = base64(indices);
  object["layers"] = layers.empty() ? std::set<int>{0} : layers;
  return object;
}

Json colour_table() {
  constexpr int kColours = 64;
  Json table = Json::array();
  for (int i = 0; i < kColours; ++i)
    table.push_back(map_colour(ColourMap::Sequential, double(i) / (kColours - 1)));
  return table;
}

Json array_of(const Vec3d& v) { return Json::array({v.x, v.y, v.z}); }

// What the page's markers stand for, in any order.
std::string filled(std::string page,
                   const std::vector<std::pair<std::string, std::string>>& parts) {
  std::string result;
  for (std::size_t at = 0; at < page.size();) {
    std::size_t next = page.size();
    const std::pair<std::string, std::string>* found = nullptr;
    for (const auto& part : parts) {
      const std::size_t place = page.find(part.first, at);
      if (place < next) {
        next = place;
        found = &part;
      }
    }
    result.append(page, at, next - at);
    if (!found) break;
    result += found->second;
    at = next + found->first.size();
  }
  return result;
}

}  // namespace

std::vector<std::string> write_record_page(const std::filesystem::path& file,
                                           const CacheContents& contents,
                                           const RecordPageOptions& options) {
  const std::string three_js = read_three_js(options.three_js);
  std::vector<std::string> warnings;
  // Keys are hashes: every n-th in their order is an even choice.
  const std::size_t count = contents.records.size();
  const std::size_t step = std::max<std::size_t>(
      1, (count + options.max_records - 1) / std::max<std::size_t>(1, options.max_records));
  std::vector<std::size_t> chosen;
  Box3d box;
  for (std::size_t i = 0; i < count; i += step) {
    if (record_fault(contents.records[i])) continue;
    chosen.push_back(i);
    box.extendBy(contents.header.origin + vector(contents.records[i].position));
  }
  if (step > 1)
    warnings.push_back(printable(file.string()) + ": shows " + std::to_string(chosen.size()) +
                       " of " + std::to_string(count) + " records");
  std::size_t triangles = 0;
  if (options.world)
    for (const TriangleMesh& mesh : options.world->tracer().meshes())
      triangles += mesh.triangles.size();
  const bool has_surfaces = triangles > 0 && triangles <= options.max_triangles;
  if (triangles > options.max_triangles)
    warnings.push_back(printable(file.string()) + ": leaves out the surfaces: " +
                       std::to_string(triangles) + " triangles are too many for a page");
  if (has_surfaces) {
    box.extendBy(options.world->tracer().bounds().min);
    box.extendBy(options.world->tracer().bounds().max);
  }
  const Vec3d centre = box.isEmpty() ? Vec3d(0.0) : (box.min + box.max) * 0.5;
  const double diagonal = box.isEmpty() ? 0 : (box.max - box.min).length();

  Json data = record_data(contents, chosen, centre);
  data["title"] = options.title;
  data["facts"] = options.facts;
  data["centre"] = array_of(centre);
  data["diagonal"] = diagonal > 0 ? diagonal : 1;
  data["up"] = array_of(options.up.normalized());
  data["map"] = colour_table();
  data["surfaces"] = nullptr;
  if (has_surfaces) {
    const PageSurfaces surfaces =
        page_surfaces(*options.world, contents.records, contents.header.origin, centre);
    data["surfaces"] = {{"turned", base64(surfaces.turned)},
                        {"twoSided", base64(surfaces.two_sided)}};
  }
  data["camera"] = nullptr;
  if (options.camera)
    data["camera"] = {{"position", array_of(options.camera->position - centre)},
                      {"look_at", array_of(options.camera->look_at - centre)},
                      {"fov", options.camera->fov_deg}};
  // Settings and names are foreign text; "<" could end the element that holds them.
  std::string json = data.dump(-1, ' ', false, Json::error_handler_t::replace);
  for (std::size_t at = json.find('<'); at != std::string::npos; at = json.find('<', at))
    json.replace(at, 1, "\\u003c");

  namespace text = record_page_text;
  write_file_whole(file, filled(text::kPage, {{"@STYLE@", text::kStyle},
                                              {"@THREE_NOTICE@", kThreeNotice},
                                              {"@THREE@", three_js},
                                              {"@DATA@", json},
                                              {"@DATA_VIEW@", text::kDataView},
                                              {"@SHADERS@", text::kShaders},
                                              {"@RECORDS@", text::kRecords},
                                              {"@SCRIPT@", text::kScript}}));
  return warnings;
}

}  // namespace brume
