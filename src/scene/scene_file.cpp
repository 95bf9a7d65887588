#include "scene/scene_file.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "scene/input_file.h"
#include "scene/json_text.h"
#include "scene/scene_check.h"
#include "scene/scene_load.h"

namespace brume {
namespace {

// A scene file is written by hand or by a script; data belongs in meshes and volumes.
constexpr std::uint64_t kMaxSceneBytes = std::uint64_t{64} << 20;
constexpr double kMaxPixels = 1 << 28;

Vec3d direction(const ObjectView& view, std::string_view key) {
  const Vec3d d = view.vector(key);
  const double length = d.length();
  if (!(length > 0) || !std::isfinite(length))
    view.fail(key, "a direction needs a length", "give the way the light travels");
  return d / length;
}

Camera read_camera(const ObjectView& view, const Vec3d& scene_up) {
  Camera camera;
  camera.position = view.vector("position");
  camera.look_at = view.vector("look_at");
  camera.up = view.has("up") ? view.vector("up") : scene_up;
  camera.fov_deg = view.number("fov_deg");
  const Vec3d forward = camera.look_at - camera.position;
  if (!(forward.length() > 0))
    view.fail("look_at", "is the same point as position", "look somewhere else");
  if (!(camera.up.length() > 0)) view.fail("up", "has no length", "give a direction");
  if (forward.normalized().cross(camera.up.normalized()).length() < 1e-9)
    view.fail(view.has("up") ? "up" : "look_at", "the view is parallel to up",
              "turn up or the view");
  return camera;
}

LightDescription read_light(SceneLoad& load, const ObjectView& view) {
  const std::string type = view.text("type");
  if (type == "point") return PointLight{view.vector("position"), view.color("intensity")};
  if (type == "spot") {
    const double inner = view.number("inner_deg"), outer = view.number("outer_deg");
    if (inner > outer)
      view.fail(view.has("inner_deg") ? "inner_deg" : "outer_deg",
                "the inner half angle is larger than the outer one", "give inner_deg <= outer_deg");
    return SpotLight{view.vector("position"), direction(view, "direction"), view.color("intensity"),
                     inner, outer};
  }
  if (type == "directional")
    return DirectionalLight{direction(view, "direction"), view.color("irradiance")};
  if (type == "quad") {
    const QuadLight quad{view.vector("corner"), view.vector("edge_u"), view.vector("edge_v"),
                         view.color("radiance")};
    const double lengths = quad.edge_u.length() * quad.edge_v.length();
    if (!(quad.edge_u.cross(quad.edge_v).length() > 1e-9 * lengths))
      view.fail("edge_v", "the edges span no area", "give edges that are not parallel");
    return quad;
  }
  EnvironmentLight environment;
  if (view.has("file") == view.has("radiance"))
    view.fail(view.has("file") ? "both file and radiance are given"
                               : "neither file nor radiance is given",
              "give one of them");
  if (view.has("file"))
    environment.file = resolve_input(load, view, "file");
  else
    environment.radiance = view.color("radiance");
  environment.scale = view.number("scale");
  environment.rotation_deg = view.number("rotation_deg");
  return environment;
}

void read_film(const ObjectView& view, Scene& scene) {
  const auto size = view.numbers("resolution");
  if (size[0] * size[1] > kMaxPixels)
    view.fail("resolution", "more than 2^28 pixels", "render it in parts");
  scene.film = {int(size[0]), int(size[1])};
}

RenderSettings read_render(const ObjectView& view) {
  RenderSettings r;
  r.bounces = int(view.integer("bounces"));
  if (!view.is_auto("volume_bounces")) r.volume_bounces = int(view.integer("volume_bounces"));
  r.seed = std::uint64_t(view.integer("seed"));
  const auto cells = view.numbers("cells");
  r.cells_theta = int(cells[0]);
  r.cells_phi = int(cells[1]);
  r.shells = int(view.integer("shells"));
  r.footprint = view.number("footprint");
  r.lamp_samples = int(view.integer("lamp_samples"));
  r.step_voxels = view.number("step_voxels");
  return r;
}

void read_cache(SceneLoad& load, const ObjectView& view) {
  const std::string mode = view.text("mode"), name = view.text("file");
  load.scene.cache.mode = mode == "new"      ? CacheMode::New
                          : mode == "append" ? CacheMode::Append
                          : mode == "read"   ? CacheMode::Read
                                             : CacheMode::Missing;
  if (load.has_frame_numbers && name.find("##") == std::string::npos)
    view.fail("file",
              "one cache for inputs that change by frame would be stale on every other frame",
              "put #### into its name");
  load.scene.cache.file = resolve_path(load, view.pointer("file"), name, false);
}

// Infinite light through infinitely much medium: nothing arrives, whatever the numbers.
void refuse_unbounded_media_with_distant_light(const ObjectView& root, const Scene& scene) {
  const auto views = root.objects("volumes");
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (views[v].text("type") != "homogeneous" || views[v].has("bounds")) continue;
    if (is_black(scene.volumes[v].sigma_t())) continue;
    for (std::size_t l = 0; l < scene.lights.size(); ++l) {
      const bool is_distant = std::holds_alternative<DirectionalLight>(scene.lights[l]) ||
                              std::holds_alternative<EnvironmentLight>(scene.lights[l]);
      if (is_distant)
        views[v].fail(
            "it fills all space, so light " + std::to_string(l) + " at infinity is extinguished",
            "give it bounds");
    }
  }
}

Scene build_scene(const SceneDocument& document, const nlohmann::json& json,
                  const std::filesystem::path& file, const std::filesystem::path& folder,
                  const SceneFileOptions& options) {
  check_scene_document(document, json);
  const ObjectView root(document, json, scene_object(), "");
  Scene scene;
  scene.file = file;
  SceneLoad load{document, options, folder, scene};
  scene.unit = root.number("unit");
  const std::string up = root.text("up");
  scene.up = Vec3d(up == "X", up == "Y", up == "Z");
  if (root.has("camera")) scene.camera = read_camera(root.object("camera"), scene.up);
  for (const auto& [name, view] : root.object_map("cameras"))
    scene.cameras.emplace(name, read_camera(view, scene.up));
  read_film(root.object("film"), scene);
  scene.render = read_render(root.object("render"));
  for (const ObjectView& view : root.objects("lights"))
    scene.lights.push_back(read_light(load, view));
  load_surfaces(load, root);
  load_volumes(load, root);
  refuse_unbounded_media_with_distant_light(root, scene);
  if (root.has("cache")) read_cache(load, root.object("cache"));
  for (const ObjectView& view : root.objects("outputs"))
    scene.outputs.push_back(
        {resolve_path(load, view.pointer("file"), view.text("file"), false), view.texts("aovs")});
  return scene;
}

}  // namespace

Scene load_scene_text(std::string_view text, const std::filesystem::path& file,
                      const std::filesystem::path& folder, const SceneFileOptions& options) {
  SceneDocument document(printable(file.string()));
  nlohmann::json json = parse_json_text(text, document.file());
  for (const std::string& o : options.overrides) document.apply_override(json, o);
  return build_scene(document, json, file, folder, options);
}

Scene load_scene(const std::filesystem::path& file, const SceneFileOptions& options) {
  const std::string text = read_regular_file(file, kMaxSceneBytes);
  return load_scene_text(text, file, file.parent_path(), options);
}

}  // namespace brume
