#include "cli/scene_summary.h"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <type_traits>

namespace brume {
namespace {

using nlohmann::ordered_json;

// Samples along each edge of a volume's box; the mean of a grid is known to about 1 % from them.
constexpr int kSamples = 48;

template <typename V>
ordered_json list3(const V& v) {
  return {v[0], v[1], v[2]};
}

ordered_json box_json(const Box3d& box) {
  if (box.isEmpty()) return nullptr;
  if (!std::isfinite(box.max.x)) return "unbounded";
  return {list3(box.min), list3(box.max)};
}

ordered_json camera_json(const Camera& camera) {
  return {{"position", list3(camera.position)},
          {"look_at", list3(camera.look_at)},
          {"up", list3(camera.up)},
          {"fov_deg", camera.fov_deg}};
}

ordered_json light_json(const LightDescription& light) {
  return std::visit(
      [](const auto& l) -> ordered_json {
        using T = std::decay_t<decltype(l)>;
        if constexpr (std::is_same_v<T, PointLight>)
          return {{"type", "point"},
                  {"position", list3(l.position)},
                  {"intensity", list3(l.intensity)}};
        else if constexpr (std::is_same_v<T, SpotLight>)
          return {{"type", "spot"},
                  {"position", list3(l.position)},
                  {"direction", list3(l.direction)},
                  {"intensity", list3(l.intensity)},
                  {"inner_deg", l.inner_deg},
                  {"outer_deg", l.outer_deg}};
        else if constexpr (std::is_same_v<T, DirectionalLight>)
          return {{"type", "directional"},
                  {"direction", list3(l.direction)},
                  {"irradiance", list3(l.irradiance)}};
        else if constexpr (std::is_same_v<T, QuadLight>)
          return {{"type", "quad"},
                  {"corner", list3(l.corner)},
                  {"edge_u", list3(l.edge_u)},
                  {"edge_v", list3(l.edge_v)},
                  {"radiance", list3(l.radiance)}};
        else if (l.file.empty())
          return {{"type", "environment"}, {"radiance", list3(l.radiance)}, {"scale", l.scale}};
        else
          return {{"type", "environment"}, {"file", l.file.string()}, {"scale", l.scale}};
      },
      light);
}

ordered_json material_json(const Material& m, std::size_t triangles) {
  ordered_json json{{"name", m.name},
                    {"type", m.is_glossy() ? "glossy" : "diffuse"},
                    {"albedo", list3(m.albedo)}};
  if (m.is_glossy()) {
    json["specular"] = list3(m.specular);
    json["roughness"] = m.roughness;
  }
  if (m.is_emissive()) {
    json["emission"] = list3(m.emission);
    json["direct"] = m.direct;
    json["two_sided"] = m.two_sided;
  }
  json["triangles"] = triangles;
  return json;
}

const char* mode_name(Emission::Mode mode) {
  switch (mode) {
    case Emission::Mode::None:
      return "none";
    case Emission::Mode::Density:
      return "density";
    case Emission::Mode::Grid:
      return "grid";
    case Emission::Mode::Blackbody:
      return "blackbody";
  }
  return "none";
}

ordered_json volume_json(const Volume& volume) {
  ordered_json json{{"name", volume.name},
                    {"type", volume.is_homogeneous() ? "homogeneous" : "vdb"},
                    {"bounds", box_json(volume.world_bounds())}};
  if (volume.density) {
    json["voxel_size"] = volume.density->voxel_size();
    json["density_range"] = {volume.density->range().min, volume.density->range().max};
    json["memory_bytes"] = volume.density->memory_bytes();
  }
  json["sigma_s"] = list3(volume.sigma_s);
  json["sigma_a"] = list3(volume.sigma_a);
  json["anisotropy"] = volume.phase.g();
  json["albedo_grid"] = !volume.albedo_grid.empty();
  const Vec3d depth = mean_optical_depth(volume);
  json["mean_optical_depth"] = std::isfinite(depth.x) ? list3(depth) : ordered_json("infinite");
  const Emission& e = volume.emission;
  json["emission"] = {{"mode", mode_name(e.mode)}};
  if (e.mode != Emission::Mode::None) json["emission"]["scale"] = e.scale;
  if (e.mode == Emission::Mode::Blackbody)
    json["emission"]["temperature_scale"] = e.temperature_scale;
  else if (e.mode != Emission::Mode::None)
    json["emission"]["color"] = list3(e.color);
  return json;
}

ordered_json settings_json(const Scene& scene) {
  const RenderSettings& r = scene.render;
  ordered_json json{
      {"resolution", {scene.film.width, scene.film.height}},
      {"bounces", r.bounces},
      {"volume_bounces", r.volume_bounces ? ordered_json(*r.volume_bounces) : ordered_json("auto")},
      {"seed", r.seed},
      {"cells", {r.cells_theta, r.cells_phi}},
      {"shells", r.shells},
      {"footprint", r.footprint},
      {"lamp_samples", r.lamp_samples},
      {"step_voxels", r.step_voxels}};
  if (!scene.cache.file.empty()) {
    constexpr std::array<const char*, 4> kModes{"new", "append", "missing", "read"};
    json["cache"] = {{"file", scene.cache.file.string()},
                     {"mode", kModes[std::size_t(scene.cache.mode)]}};
  }
  for (const OutputSettings& output : scene.outputs)
    json["outputs"].push_back({{"file", output.file.string()}, {"aovs", output.aovs}});
  return json;
}

Box3d mesh_bounds(const TriangleMesh& mesh) {
  Box3d box;
  for (const auto& t : mesh.triangles)
    for (const std::uint32_t i : t) box.extendBy(mesh.positions[i]);
  return box;
}

std::vector<std::size_t> triangles_by_material(const Scene& scene) {
  std::vector<std::size_t> counts(scene.materials.size());
  for (const TriangleMesh& mesh : scene.meshes)
    for (const std::uint32_t m : mesh.materials) ++counts[m];
  return counts;
}

bool is_short(const ordered_json& value) {
  if (value.is_object()) return false;
  if (!value.is_array()) return true;
  for (const ordered_json& entry : value)
    if (entry.is_structured() && !(entry.is_array() && is_short(entry))) return false;
  return true;
}

void write_value(std::ostream& out, const ordered_json& value, const std::string& indent) {
  for (const auto& [key, member] : value.items()) {
    if (member.empty() && member.is_structured()) continue;
    out << indent << (value.is_array() ? "- " : key + ": ");
    if (is_short(member)) {
      out << (member.is_string()
                  ? member.get<std::string>()
                  : member.dump(-1, ' ', false, ordered_json::error_handler_t::replace))
          << '\n';
      continue;
    }
    out << '\n';
    write_value(out, member, indent + "  ");
  }
}

}  // namespace

Vec3d mean_optical_depth(const Volume& volume) {
  const Box3d box = volume.world_bounds();
  if (volume.is_empty() || box.isEmpty()) return Vec3d(0.0);
  const Vec3d size = box.max - box.min;
  const double sigma_t = volume.sigma_t().g;
  if (volume.is_homogeneous()) return size * sigma_t;
  double sum = 0;
  for (int z = 0; z < kSamples; ++z)
    for (int y = 0; y < kSamples; ++y)
      for (int x = 0; x < kSamples; ++x)
        sum += volume.density_at(box.min + size * Vec3d((x + 0.5) / kSamples, (y + 0.5) / kSamples,
                                                        (z + 0.5) / kSamples));
  return size * (sigma_t * sum / (double(kSamples) * kSamples * kSamples));
}

SceneSummary summarize(const Scene& scene) {
  SceneSummary summary;
  for (const TriangleMesh& mesh : scene.meshes) summary.triangles += mesh.triangles.size();
  const auto counts = triangles_by_material(scene);
  for (std::size_t i = 0; i < counts.size(); ++i)
    if (counts[i] > 0 && scene.materials[i].is_emissive() && scene.materials[i].direct)
      ++summary.mesh_lights;
  return summary;
}

ordered_json summary_json(const Scene& scene) {
  const SceneSummary summary = summarize(scene);
  ordered_json json{{"file", scene.file.string()}, {"unit", scene.unit}, {"up", list3(scene.up)}};
  ordered_json& cameras = json["cameras"] = ordered_json::object();
  if (scene.camera) cameras[""] = camera_json(*scene.camera);
  for (const auto& [name, camera] : scene.cameras) cameras[name] = camera_json(camera);
  Box3d bounds;
  ordered_json& meshes = json["meshes"] = ordered_json::array();
  for (const TriangleMesh& mesh : scene.meshes) {
    const Box3d box = mesh_bounds(mesh);
    if (!box.isEmpty()) bounds.extendBy(box);
    meshes.push_back({{"name", mesh.name},
                      {"triangles", mesh.triangles.size()},
                      {"bounds", box_json(box)},
                      {"normals", !mesh.normals.empty()},
                      {"casts_shadow", mesh.casts_shadow}});
  }
  json["triangles"] = summary.triangles;
  json["mesh_bounds"] = box_json(bounds);
  const auto counts = triangles_by_material(scene);
  ordered_json& materials = json["materials"] = ordered_json::array();
  for (std::size_t i = 0; i < scene.materials.size(); ++i)
    materials.push_back(material_json(scene.materials[i], counts[i]));
  ordered_json& lights = json["lights"] = ordered_json::array();
  for (const LightDescription& light : scene.lights) lights.push_back(light_json(light));
  json["mesh_lights"] = summary.mesh_lights;
  ordered_json& volumes = json["volumes"] = ordered_json::array();
  for (const Volume& volume : scene.volumes) volumes.push_back(volume_json(volume));
  json["grids"] = scene.grids;
  json["bad_voxels"] = {{"nan", scene.bad_voxels.nan},
                        {"infinite", scene.bad_voxels.infinite},
                        {"negative", scene.bad_voxels.negative}};
  json["settings"] = settings_json(scene);
  return json;
}

void write_summary_text(std::ostream& out, const ordered_json& summary) {
  write_value(out, summary, "");
}

}  // namespace brume
