#include "scene/gltf_nodes.h"

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <set>

#include "core/error.h"
#include "scene/json_text.h"

namespace brume {
namespace {

using nlohmann::json;

// Photometric to radiometric: lm/W at 555 nm, as SPEC fixes it.
constexpr double kLumensPerWatt = 683;
// Deeper node trees are cyclic or hostile.
constexpr int kMaxNodeDepth = 256;

// The JSON of a .glb is its first chunk, after two headers of 12 and 8 bytes.
std::string_view json_of(std::string_view bytes, const std::string& name) {
  if (bytes.substr(0, 4) != "glTF") return bytes;
  std::uint32_t length = 0, kind = 0;
  if (bytes.size() >= 20) {
    std::memcpy(&length, bytes.data() + 12, 4);
    std::memcpy(&kind, bytes.data() + 16, 4);
  }
  constexpr std::uint32_t kJsonChunk = 0x4e4f534a;
  if (kind != kJsonChunk || length > bytes.size() - 20)
    throw Error(ErrorKind::InvalidInput, name + ": a damaged glb file: export it again");
  return bytes.substr(20, length);
}

class Reader {
 public:
  Reader(const json& root, const std::string& name, ImportedFile& imported)
      : root_(root), name_(name), imported_(imported) {}

  void read() {
    const json& scenes = list("scenes");
    const json& nodes = list("nodes");
    if (scenes.empty()) {
      // Without a scene every node that is nobody's child is a root.
      std::set<std::size_t> children;
      for (const json& node : nodes)
        for (const std::size_t child : indices(node, "children")) children.insert(child);
      for (std::size_t i = 0; i < nodes.size(); ++i)
        if (!children.contains(i)) visit(i, Affine3d{}, 0);
    } else {
      const auto chosen = index(root_, "scene").value_or(0);
      if (chosen < scenes.size())
        for (const std::size_t node : indices(scenes[chosen], "nodes")) visit(node, Affine3d{}, 0);
    }
    say_what_is_dropped();
  }

  std::map<std::string, double> emission_strengths() const {
    std::map<std::string, double> strengths;
    for (const json& material : list("materials")) {
      const json& extension =
          member(member(material, "extensions"), "KHR_materials_emissive_strength");
      if (const std::string found = text(material, "name"); !found.empty())
        strengths.emplace(found, number(extension, "emissiveStrength", 1));
    }
    return strengths;
  }

 private:
  static const json& member(const json& object, const char* key) {
    static const json kNull;
    if (!object.is_object()) return kNull;
    const auto it = object.find(key);
    return it == object.end() ? kNull : *it;
  }
  const json& list(const char* key) const {
    static const json kEmpty = json::array();
    const json& found = member(root_, key);
    return found.is_array() ? found : kEmpty;
  }
  static std::optional<std::size_t> index(const json& object, const char* key) {
    const json& found = member(object, key);
    if (!found.is_number_unsigned()) return std::nullopt;
    return found.get<std::size_t>();
  }
  static std::vector<std::size_t> indices(const json& object, const char* key) {
    std::vector<std::size_t> out;
    const json& found = member(object, key);
    if (found.is_array())
      for (const json& entry : found)
        if (entry.is_number_unsigned()) out.push_back(entry.get<std::size_t>());
    return out;
  }
  static double number(const json& object, const char* key, double fallback) {
    const json& found = member(object, key);
    return found.is_number() ? found.get<double>() : fallback;
  }
  static std::vector<double> numbers(const json& object, const char* key, std::size_t count) {
    std::vector<double> out;
    const json& found = member(object, key);
    if (found.is_array() && found.size() == count)
      for (const json& entry : found) out.push_back(entry.is_number() ? entry.get<double>() : 0);
    return out;
  }
  static std::string text(const json& object, const char* key) {
    const json& found = member(object, key);
    return found.is_string() ? found.get<std::string>() : std::string();
  }

  static Affine3d local_transform(const json& node) {
    Affine3d m;
    if (const auto matrix = numbers(node, "matrix", 16); !matrix.empty()) {
      for (std::size_t i = 0; i < 12; ++i) m.m[i / 4][i % 4] = matrix[(i % 4) * 4 + i / 4];
      return m;
    }
    if (const auto q = numbers(node, "rotation", 4); !q.empty()) {
      const double x = q[0], y = q[1], z = q[2], w = q[3];
      m.m[0] = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 0};
      m.m[1] = {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), 0};
      m.m[2] = {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), 0};
    }
    if (const auto s = numbers(node, "scale", 3); !s.empty())
      for (auto& row : m.m)
        for (std::size_t c = 0; c < 3; ++c) row[c] *= s[c];
    if (const auto t = numbers(node, "translation", 3); !t.empty())
      for (std::size_t r = 0; r < 3; ++r) m.m[r][3] = t[r];
    return m;
  }

  void visit(std::size_t number_of_node, const Affine3d& parent, int depth) {
    const json& nodes = list("nodes");
    if (number_of_node >= nodes.size()) return;
    // A node shared by two parents is no tree; without a bound it could stand for 2^depth visits.
    if (depth > kMaxNodeDepth || ++visits_ > 4 * nodes.size() + 16)
      throw Error(ErrorKind::InvalidInput,
                  name_ + ": its nodes do not form a tree: export it again");
    const json& node = nodes[number_of_node];
    const Affine3d to_world = parent * local_transform(node);
    if (const auto camera = index(node, "camera")) add_camera(*camera, node, to_world);
    const json& extension = member(member(node, "extensions"), "KHR_lights_punctual");
    if (const auto light = index(extension, "light")) add_light(*light, to_world);
    for (const std::size_t child : indices(node, "children")) visit(child, to_world, depth + 1);
  }

  void add_camera(std::size_t number_of_camera, const json& node, const Affine3d& to_world) {
    const json& cameras = list("cameras");
    if (number_of_camera >= cameras.size()) return;
    const json& source = cameras[number_of_camera];
    std::string name = text(source, "name");
    if (name.empty()) name = text(node, "name");
    if (name.empty()) name = "camera" + std::to_string(number_of_camera);
    if (text(source, "type") != "perspective") {
      warn("camera " + printable(name) + " is not a perspective one and is dropped");
      return;
    }
    Camera camera;
    camera.position = to_world.translation();
    const Vec3d view = to_world.vector({0, 0, -1}), up = to_world.vector({0, 1, 0});
    camera.look_at = camera.position + view.normalized();
    camera.up = up.normalized();
    camera.fov_deg = number(member(source, "perspective"), "yfov", 0) * 180 / kPi;
    if (!is_finite(camera.position) || !is_finite(camera.look_at) || !is_finite(camera.up) ||
        view.cross(up).length() == 0 || !(camera.fov_deg > 0 && camera.fov_deg < 180)) {
      warn("camera " + printable(name) + " is degenerate and is dropped");
      return;
    }
    imported_.cameras.emplace_back(name, camera);
  }

  void add_light(std::size_t number_of_light, const Affine3d& to_world) {
    const json& lights =
        member(member(member(root_, "extensions"), "KHR_lights_punctual"), "lights");
    if (!lights.is_array() || number_of_light >= lights.size()) return;
    const json& source = lights[number_of_light];
    const std::string kind = text(source, "type");
    auto color = numbers(source, "color", 3);
    if (color.empty()) color = {1, 1, 1};
    const double scale = number(source, "intensity", 1) / kLumensPerWatt;
    const RgbD power(color[0] * scale, color[1] * scale, color[2] * scale);
    const Vec3d position = to_world.translation(), travel = to_world.vector({0, 0, -1});
    const double length = travel.length();
    if (!is_finite(power) || power.r < 0 || power.g < 0 || power.b < 0 || !is_finite(position) ||
        !std::isfinite(length) || (length == 0 && kind != "point")) {
      warn("light " + std::to_string(number_of_light) + " is degenerate and is dropped");
      return;
    }
    if (source.contains("range"))
      warn("light " + std::to_string(number_of_light) + ": its range is dropped");
    if (kind == "point") {
      imported_.lights.emplace_back(PointLight{position, Rgb(power)});
    } else if (kind == "directional") {
      imported_.lights.emplace_back(DirectionalLight{travel / length, Rgb(power)});
    } else if (kind == "spot") {
      const json& cone = member(source, "spot");
      const double inner = number(cone, "innerConeAngle", 0) * 180 / kPi;
      const double outer = number(cone, "outerConeAngle", kPi / 4) * 180 / kPi;
      if (!(inner >= 0 && inner <= outer && outer > 0 && outer <= 90)) {
        warn("light " + std::to_string(number_of_light) + " has an impossible cone and is dropped");
        return;
      }
      imported_.lights.emplace_back(SpotLight{position, travel / length, Rgb(power), inner, outer});
    } else {
      warn("light " + std::to_string(number_of_light) + " of type \"" + printable(kind) +
           "\" is dropped");
    }
  }

  void say_what_is_dropped() {
    static const std::set<std::string> kRead{"KHR_lights_punctual",
                                             "KHR_materials_emissive_strength",
                                             "KHR_mesh_quantization", "KHR_texture_transform"};
    std::string dropped;
    for (const json& extension : list("extensionsUsed"))
      if (extension.is_string() && !kRead.contains(extension.get<std::string>()))
        dropped += (dropped.empty() ? "" : ", ") + printable(extension.get<std::string>(), 60);
    if (!dropped.empty())
      warn("extensions that are not read are dropped: " + printable(dropped, 300));
    if (!list("animations").empty()) warn("animations are dropped; nodes stand as written");
    if (!list("skins").empty()) warn("skins are dropped; meshes stand as written");
  }

  void warn(const std::string& what) { imported_.warnings.push_back(name_ + ": " + what); }

  const json& root_;
  const std::string& name_;
  ImportedFile& imported_;
  std::size_t visits_ = 0;
};

}  // namespace

std::map<std::string, double> read_gltf_nodes(std::string_view bytes, const std::string& name,
                                              ImportedFile& imported) {
  const json root = parse_json_text(json_of(bytes, name), name);
  Reader reader(root, name, imported);
  reader.read();
  return reader.emission_strengths();
}

}  // namespace brume
