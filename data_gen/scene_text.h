// Writes scene files and meshes in the same words and bytes every time.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/math.h"
#include "geom/triangle_mesh.h"

namespace brume {

using SceneJson = nlohmann::ordered_json;  // Keys in the order they were set.

SceneJson json_list(const Vec3d& v);
SceneJson json_list(const Box3d& b);  // [[min], [max]]
SceneJson grey(double value);       // [value, value, value]

// Indented, arrays of numbers on one line, a newline at the end.
std::string scene_text(const SceneJson& scene);

// A part of an OBJ file: its triangles under one material name.
struct ObjPart {
  std::string name, material;
  TriangleMesh mesh;
};
// `mtl_file` may be empty: then materials are names only.
std::string obj_text(const std::vector<ObjPart>& parts, const std::string& mtl_file);

// corner, corner + u, corner + u + v, corner + v: its front is the side of u x v.
void add_quad(TriangleMesh& mesh, const Vec3d& corner, const Vec3d& u, const Vec3d& v);
// Six quads with their fronts outwards, turned about the vertical (y) axis through the box's
// centre.
void add_box(TriangleMesh& mesh, const Box3d& box, double turn_deg = 0);

}  // namespace brume
