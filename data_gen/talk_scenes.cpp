#include "data_gen/talk_scenes.h"

#include "core/error.h"
#include "core/staged_file.h"
#include "data_gen/smoky_cornell.h"
#include "data_gen/talk_scene_parts.h"
#include "vdb_media/grid_writer.h"

namespace brume {

namespace {

constexpr const char* kSmokyCornell = "smoky-cornell";

void check(const TalkSceneOptions& options) {
  const auto require = [](bool good, const char* message) {
    if (!good) throw Error(ErrorKind::InvalidInput, std::string("talk: ") + message);
  };
  require(options.size_px >= 1 && options.size_px <= 16384,
          "size: outside 1 to 16384 pixels: choose a number within");
  require(options.resolution >= 2 && options.resolution <= 1024,
          "resolution: outside 2 to 1024: choose a number within");
  require(options.density >= 0 && options.density <= 1e6,
          "density: outside 0 to 1e6: choose a number within");
  require(!options.albedo || (*options.albedo >= 0 && *options.albedo <= 1),
          "albedo: outside 0 to 1: choose a number within");
  require(!options.anisotropy || (*options.anisotropy > -1 && *options.anisotropy < 1),
          "anisotropy: outside (-1, 1): choose a number within");
  require(!options.contrast || (*options.contrast >= 0 && *options.contrast <= 1),
          "contrast: outside 0 to 1: choose a number within");
  require(!options.detail || (*options.detail >= 1 && *options.detail <= 12),
          "detail: outside 1 to 12: choose a number within");
}

TalkScene make_talk_scene(const std::string& name, const TalkSceneOptions& options) {
  if (name == "absorbing") return absorbing_scene();
  if (name == "scattering") return scattering_scene();
  if (name == "no-walls") return no_walls_scene();
  if (name == "window") return window_scene(options);
  if (name == "disco") return disco_scene(options);
  std::string names;
  for (const std::string& known : talk_scene_names()) names += (names.empty() ? "" : ", ") + known;
  throw Error(ErrorKind::Usage,
              "talk: no scene is named '" + printable(name) + "': choose from " + names);
}

// The volume's keys; writes its grid where it has one.
SceneJson write_medium(const TalkMedium& medium, const TalkSceneOptions& options,
                       const std::filesystem::path& vdb,
                       std::vector<std::filesystem::path>& files) {
  const double sigma_t = medium.sigma_t * options.density;
  const double albedo = options.albedo.value_or(medium.albedo);
  SceneJson json;
  if (const auto* box = std::get_if<ConstantBox>(&medium.density)) {
    json = {{"type", "homogeneous"},
            {"bounds", json_list(box->box)},
            {"sigma_s", grey(sigma_t * albedo)},
            {"sigma_a", grey(sigma_t * (1 - albedo))}};
  } else {
    const Vec3d size = medium.bounds.size();
    const double longest = std::max(size.x, std::max(size.y, size.z));
    const Lattice lattice = covering_lattice(medium.bounds, longest / (options.resolution - 1));
    write_grids(vdb, {{.name = "density",
                       .count = lattice.count,
                       .values = sample_field(medium.density, lattice, options.threads),
                       .index_to_world = lattice.index_to_world()}});
    files.push_back(vdb);
    json = {{"type", "vdb"},
            {"file", vdb.filename().string()},
            {"grids", {{"density", "density"}}},
            {"density_scale", sigma_t},
            {"albedo", grey(albedo)}};
  }
  json["anisotropy"] = options.anisotropy.value_or(medium.anisotropy);
  return json;
}

std::vector<std::filesystem::path> write_parts(const std::string& name, const TalkScene& scene,
                                               const std::filesystem::path& folder,
                                               const TalkSceneOptions& options) {
  std::vector<std::filesystem::path> files{folder / (name + ".json")};
  SceneJson materials = SceneJson::object(), meshes = SceneJson::array();
  for (const TalkMesh& m : scene.meshes) {
    const std::string obj = name + "_" + m.name + ".obj";
    write_file_whole(folder / obj, obj_text({{m.name, m.name, m.mesh}}, ""));
    files.push_back(folder / obj);
    materials[m.name] = m.material;
    SceneJson mesh{{"file", obj}, {"material", m.name}};
    if (!m.casts_shadow) mesh["casts_shadow"] = false;
    meshes.push_back(mesh);
  }
  const SceneJson volume = write_medium(scene.medium, options, folder / (name + ".vdb"), files);
  const int height = std::max(1, static_cast<int>(std::lround(options.size_px / scene.aspect)));
  const SceneJson json{
      {"version", 1},
      {"unit", 1.0},
      {"up", "Y"},
      {"camera", scene.camera},
      {"film", {{"resolution", {options.size_px, height}}}},
      {"meshes", meshes},
      {"materials", materials},
      {"lights", scene.lights},
      {"volumes", SceneJson::array({volume})},
      {"render",
       {{"bounces", scene.bounces}, {"volume_bounces", 1}, {"seed", 1}, {"cells", {16, 50}}}}};
  // Last: a scene that is there has its files.
  write_file_whole(files.front(), scene_text(json));
  return files;
}

}  // namespace

SceneJson camera_json(const Vec3d& position, const Vec3d& look_at, double fov_deg) {
  return {{"position", json_list(position)},
          {"look_at", json_list(look_at)},
          {"up", {0, 1, 0}},
          {"fov_deg", fov_deg}};
}

SceneJson diffuse(const Vec3d& albedo) {
  return {{"type", "diffuse"}, {"albedo", json_list(albedo)}};
}

const std::vector<std::string>& talk_scene_names() {
  static const std::vector<std::string> names{"absorbing",   "scattering", "no-walls",
                                              kSmokyCornell, "window",     "disco"};
  return names;
}

Box3d talk_ground() { return {{-1.75, 0, -1.4}, {1.05, 0, 1.4}}; }

std::vector<std::filesystem::path> write_talk_scene(const std::string& name,
                                                    const std::filesystem::path& folder,
                                                    const TalkSceneOptions& options) {
  check(options);
  if (name == kSmokyCornell) {
    SmokyCornellOptions cornell;
    cornell.resolution = options.resolution;
    cornell.size_px = options.size_px;
    cornell.density = options.density;
    cornell.albedo = options.albedo;
    cornell.anisotropy = options.anisotropy;
    cornell.seed = options.seed;
    cornell.threads = options.threads;
    return write_smoky_cornell(folder, cornell);
  }
  return write_parts(name, make_talk_scene(name, options), folder, options);
}

}  // namespace brume
