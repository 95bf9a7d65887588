#include "data_gen/scene_text.h"

#include <cstdio>

namespace brume {

namespace {

bool is_flat(const SceneJson& array) {
  for (const SceneJson& item : array)
    if (item.is_object() || (item.is_array() && !is_flat(item))) return false;
  return true;
}

void append(std::string& out, const SceneJson& value, int depth) {
  const bool flat_array = value.is_array() && is_flat(value);
  if (!value.is_structured() || value.empty()) {
    out += value.dump();
    return;
  }
  const std::string indent(2 * std::size_t(depth + 1), ' ');
  const char* open = value.is_array() ? "[" : "{";
  const char* close = value.is_array() ? "]" : "}";
  out += open;
  bool first = true;
  for (const auto& [key, item] : value.items()) {
    if (!first) out += flat_array ? ", " : ",";
    first = false;
    if (!flat_array) out += "\n" + indent;
    if (value.is_object()) out += SceneJson(key).dump() + ": ";
    append(out, item, depth + 1);
  }
  if (!flat_array) out += "\n" + std::string(2 * std::size_t(depth), ' ');
  out += close;
}

std::string vertex_line(const Vec3d& p) {
  char text[96];
  // + 0.0 turns -0 into 0, so that a turn by 0 degrees writes what no turn writes.
  std::snprintf(text, sizeof text, "v %.9g %.9g %.9g\n", p.x + 0.0, p.y + 0.0, p.z + 0.0);
  return text;
}

}  // namespace

SceneJson json_list(const Vec3d& v) { return {v.x, v.y, v.z}; }
SceneJson json_list(const Box3d& b) { return {json_list(b.min), json_list(b.max)}; }
SceneJson grey(double value) { return {value, value, value}; }

std::string scene_text(const SceneJson& scene) {
  std::string out;
  append(out, scene, 0);
  return out + "\n";
}

std::string obj_text(const std::vector<ObjPart>& parts, const std::string& mtl_file) {
  std::string out;
  if (!mtl_file.empty()) out += "mtllib " + mtl_file + "\n";
  std::size_t first = 1;
  for (const ObjPart& part : parts) {
    out += "o " + part.name + "\n";
    for (const Vec3d& p : part.mesh.positions) out += vertex_line(p);
    out += "usemtl " + part.material + "\n";
    for (const auto& t : part.mesh.triangles)
      out += "f " + std::to_string(first + t[0]) + " " + std::to_string(first + t[1]) + " " +
             std::to_string(first + t[2]) + "\n";
    first += part.mesh.positions.size();
  }
  return out;
}

void add_quad(TriangleMesh& mesh, const Vec3d& corner, const Vec3d& u, const Vec3d& v) {
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {corner, corner + u, corner + u + v, corner + v});
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
}

void add_box(TriangleMesh& mesh, const Box3d& box, double turn_deg) {
  const double turn = turn_deg * kPi / 180, c = std::cos(turn), s = std::sin(turn);
  const auto turned = [&](const Vec3d& v) {
    return Vec3d(c * v.x + s * v.z, v.y, c * v.z - s * v.x);
  };
  const Vec3d centre = box.center(), size = box.size();
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d n(0.0), u(0.0), v(0.0);
    n[axis] = size[axis];
    u[(axis + 1) % 3] = size[(axis + 1) % 3];
    v[(axis + 2) % 3] = size[(axis + 2) % 3];
    // u x v is along +n; the quad on the other side has them exchanged.
    add_quad(mesh, centre + turned((n - u - v) * 0.5), turned(u), turned(v));
    add_quad(mesh, centre + turned((n + u + v) * -0.5), turned(v), turned(u));
  }
}

}  // namespace brume
