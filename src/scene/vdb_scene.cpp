// A scene around a bare volume. It is written as a scene file and read by the same code, so
// overrides work on it, and what was chosen can be pasted into a file of one's own.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "scene/input_file.h"
#include "scene/scene_file.h"
#include "scene/scene_load.h"

namespace brume {
namespace {

using nlohmann::ordered_json;

constexpr double kFovDeg = 40;
// Of the hottest voxel: an orange flame.
constexpr double kHottestKelvin = 1900;
// Radiance per optical depth of the hottest voxel, against a sun of 3 W/m^2.
constexpr double kHottestRadiance = 4;
// Grids whose maximum lies above this hold kelvin; simulations otherwise normalise.
constexpr double kLooksLikeKelvin = 300;

ordered_json list(const Vec3d& v) { return {v.x, v.y, v.z}; }

// Short numbers make notes that can be read and typed.
double rounded(double x) {
  if (x == 0 || !std::isfinite(x)) return x;
  const double digit = std::pow(10.0, std::floor(std::log10(std::abs(x))) - 3);
  return std::round(x / digit) * digit;
}
Vec3d rounded(const Vec3d& v, double size) {
  const double digit = std::pow(10.0, std::floor(std::log10(size)) - 3);
  return {std::round(v.x / digit) * digit, std::round(v.y / digit) * digit,
          std::round(v.z / digit) * digit};
}

const GridInfo* find_role(const GridFileInfo& info, GridRole role) {
  for (const GridInfo& grid : info.grids)
    if (grid.role == role) return &grid;
  return nullptr;
}

const GridInfo& find_density(const GridFileInfo& info, const std::string& file, bool& is_guess) {
  if (const GridInfo* grid = find_role(info, GridRole::Density)) return *grid;
  // One grid that could be nothing else will do.
  const GridInfo* only = nullptr;
  std::string names;
  int candidates = 0;
  for (const GridInfo& grid : info.grids) {
    names +=
        (names.empty() ? "" : ", ") + grid.name + " (" + grid.type + ", " + grid.grid_class + ")";
    const bool is_scalar = grid.type == "float" || grid.type == "half" || grid.type == "double" ||
                           grid.type == "int32";
    if (grid.role || !is_scalar || grid.grid_class == "level set") continue;
    only = &grid;
    ++candidates;
  }
  if (candidates != 1)
    throw Error(ErrorKind::InvalidInput,
                file + ": no grid has a usual name for density; the file holds " +
                    (names.empty() ? "none" : printable(names, 400)) +
                    ": write a scene file that names one in /volumes/0/grids");
  is_guess = true;
  return *only;
}

// A large square below the volume; the file format has no mesh without a file.
TriangleMesh ground_plane(double y, const Vec3d& centre, double half_width,
                          std::uint32_t material) {
  TriangleMesh plane;
  plane.name = "ground";
  for (const auto& [x, z] : {std::pair{-1., -1.}, {-1., 1.}, {1., 1.}, {1., -1.}})
    plane.positions.emplace_back(centre.x + x * half_width, y, centre.z + z * half_width);
  plane.triangles = {{0, 1, 2}, {0, 2, 3}};
  plane.materials = {material, material};
  return plane;
}

}  // namespace

VdbScene make_vdb_scene(const std::filesystem::path& vdb, const SceneFileOptions& options) {
  const std::string file = printable(vdb.string());
  check_confined(vdb, options.confine);
  check_regular_file(vdb);
  const GridFileInfo info = inspect_grid_file(vdb, options.grids);
  bool is_guess = false;
  const GridInfo& density = find_density(info, file, is_guess);
  const GridInfo* heat = find_role(info, GridRole::Temperature);
  if (!heat) heat = find_role(info, GridRole::Flame);
  if (heat && !(heat->max > 0)) heat = nullptr;

  // An empty grid still makes a picture: of the ground.
  Box3d box = density.world_bounds;
  if (box.isEmpty()) box = {Vec3d(-1.0), Vec3d(1.0)};
  const Vec3d centre = (box.min + box.max) * 0.5;
  const double radius = std::max((box.max - box.min).length() * 0.5, 1e-9);
  if (!is_finite(centre) || !std::isfinite(radius))
    throw Error(ErrorKind::InvalidInput,
                file + ": grid " + density.name +
                    ": its place in the world is not finite: write a scene file with a transform");

  ordered_json volume{
      {"type", "vdb"},
      {"file", vdb.filename().string()},
      {"grids", {{"density", density.name}}},
      {"density_scale",
       rounded(density.proposed_density_scale > 0 ? density.proposed_density_scale : 1)},
      {"albedo", {0.9, 0.9, 0.9}},
      {"anisotropy", 0}};
  if (heat) {
    const double scale = heat->max > kLooksLikeKelvin ? 1 : kHottestKelvin / heat->max;
    const double hottest = max_component(blackbody_radiance(heat->max * scale));
    volume["grids"]["temperature"] = heat->name;
    volume["emission"] = {{"mode", "blackbody"},
                          {"temperature_scale", rounded(scale)},
                          {"scale", rounded(hottest > 0 ? kHottestRadiance / hottest : 1)}};
  }

  // Three-quarter view from a little above; the sphere around the box fits the smaller side.
  const Vec3d towards_eye = Vec3d(0.75, 0.35, 1.0).normalized();
  const double distance = 1.1 * radius / std::sin(kFovDeg / 2 * kPi / 180);
  const ordered_json camera{{"position", list(rounded(centre + towards_eye * distance, distance))},
                            {"look_at", list(rounded(centre, radius))},
                            {"fov_deg", kFovDeg}};
  const ordered_json sun{
      {"type", "directional"}, {"direction", {-0.6, -1, -0.4}}, {"irradiance", {3, 2.85, 2.6}}};
  const ordered_json sky{{"type", "environment"}, {"radiance", {0.2, 0.26, 0.35}}};
  const ordered_json materials{{"ground", {{"albedo", {0.35, 0.35, 0.35}}}}};
  const ordered_json json{{"version", 1},
                          {"camera", camera},
                          {"materials", materials},
                          {"lights", {sun, sky}},
                          {"volumes", {volume}}};

  VdbScene out;
  out.scene = load_scene_text(json.dump(), vdb, vdb.parent_path(), options);
  const double y = rounded(Vec3d(0, box.min.y - 0.05 * radius, 0), radius).y;
  const double half_width = rounded(20 * radius);
  const auto ground = std::find_if(out.scene.materials.begin(), out.scene.materials.end(),
                                   [](const Material& m) { return m.name == "ground"; });
  if (ground != out.scene.materials.end())
    out.scene.meshes.push_back(
        ground_plane(y, centre, half_width, std::uint32_t(ground - out.scene.materials.begin())));

  const auto note = [&](const std::string& pointer, const ordered_json& value) {
    out.notes.push_back("chose " + pointer + " = " + value.dump());
  };
  if (is_guess)
    out.notes.push_back("no grid has a usual name for density; took the only scalar one, " +
                        density.name);
  for (const GridInfo& grid : info.grids)
    if (&grid != &density && &grid != heat)
      out.notes.push_back("grid " + grid.name + " is not used");
  note("/volumes/0", volume);
  note("/camera", camera);
  note("/lights/0", sun);
  note("/lights/1", sky);
  note("/materials", materials);
  if (ground != out.scene.materials.end())
    out.notes.push_back("chose a ground plane at y = " + ordered_json(y).dump() +
                        ", from the centre " + ordered_json(half_width).dump() +
                        " to each side, of material \"ground\"");
  return out;
}

}  // namespace brume
