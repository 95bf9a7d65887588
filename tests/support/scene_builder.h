// Scenes made in memory, a rectangle at a time.
#pragma once

#include <string>

#include "scene/scene.h"

namespace brume::test {

inline std::uint32_t add_material(Scene& scene, const Material& material) {
  scene.materials.push_back(material);
  return static_cast<std::uint32_t>(scene.materials.size() - 1);
}

inline Material diffuse(float albedo) {
  Material m;
  m.albedo = Rgb(albedo);
  return m;
}

// Seen by gathers only, on the side its winding faces.
inline Material gathered_emitter(float radiance) {
  Material m = diffuse(0);
  m.emission = Rgb(radiance);
  m.direct = false;
  return m;
}

// Faces edge_u x edge_v.
inline void add_rectangle(Scene& scene, const Vec3d& corner, const Vec3d& edge_u, const Vec3d& edge_v,
                          std::uint32_t material) {
  TriangleMesh mesh;
  mesh.positions = {corner, corner + edge_u, corner + edge_u + edge_v, corner + edge_v};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  mesh.materials = {material, material};
  scene.meshes.push_back(mesh);
}

// The six walls of a box, facing inwards.
inline void add_room(Scene& scene, const Box3d& box, std::uint32_t material) {
  const Vec3d a = box.min, d = box.max - box.min;
  const Vec3d x(d.x, 0, 0), y(0, d.y, 0), z(0, 0, d.z);
  add_rectangle(scene, a, x, y, material);
  add_rectangle(scene, a + z, y, x, material);
  add_rectangle(scene, a, y, z, material);
  add_rectangle(scene, a + x, z, y, material);
  add_rectangle(scene, a, z, x, material);
  add_rectangle(scene, a + y, x, z, material);
}

}  // namespace brume::test
