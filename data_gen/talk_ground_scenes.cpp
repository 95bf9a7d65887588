// The scenes of the talk that have a ground plane: where its irradiance and gradient are looked at.
#include "data_gen/talk_scene_parts.h"

namespace brume {

namespace {

// All three share ground and block, so that their figures compare.
const Box3d kBlock({0.3, 0, -0.2}, {0.6, 0.5, 0.3});
const Box3d kAir({-2, -0.05, -2}, {2, 2.5, 2});  // From just below the ground.
constexpr double kGroundSize = 8;

TalkMesh ground(double albedo) {
  TalkMesh mesh{"ground", diffuse(Vec3d(albedo))};
  add_quad(mesh.mesh, {-kGroundSize / 2, 0, -kGroundSize / 2}, {0, 0, kGroundSize},
           {kGroundSize, 0, 0});
  return mesh;
}

TalkMesh block() {
  TalkMesh mesh{"block", diffuse({0.55, 0.42, 0.3})};
  add_box(mesh.mesh, kBlock);
  return mesh;
}

SceneJson ground_camera() { return camera_json({-2.7, 2.1, 2.9}, {0.2, 0.45, -0.1}, 41); }

}  // namespace

TalkScene absorbing_scene() {
  TalkScene scene{.camera = ground_camera(), .medium = {}};
  TalkMesh panel{"panel", diffuse({0.85, 0.8, 0.7})};
  add_quad(panel.mesh, {1.2, 0.15, -0.95}, {0, 0, 1.9}, {0, 1.5, 0});  // Faces -x.
  scene.meshes = {ground(0.6), block(), panel};
  // The whole of its beam falls on the panel: the ground sees that light reflected, and no other.
  const Vec3d lamp(-1.4, 2.1, 0), target(1.2, 0.9, 0);
  scene.lights.push_back({{"type", "spot"},
                          {"position", json_list(lamp)},
                          {"direction", json_list((target - lamp).normalized())},
                          {"intensity", {60, 57, 50}},
                          {"inner_deg", 10},
                          {"outer_deg", 11}});
  const GaussianSum cloud{0.15,
                          {{{0.45, 0.55, 0.7}, 1.2, 0.32},
                           {{0.1, 0.35, -0.75}, 1.0, 0.3},
                           {{-0.55, 0.3, 0.1}, 0.6, 0.25}}};
  scene.medium = {cloud, kAir, 1.6, 0.0, 0.0};
  return scene;
}

TalkScene scattering_scene() {
  TalkScene scene{.camera = ground_camera(), .medium = {}};
  TalkMesh plate{"plate", diffuse(Vec3d(0.3))};
  add_box(plate.mesh, {{-0.5, 1.5, -0.5}, {0.5, 1.55, 0.5}});
  scene.meshes = {ground(0.6), block(), plate};
  // At this height the plate's shadow covers the ground below the medium whole.
  scene.lights.push_back(
      {{"type", "point"}, {"position", {0.1, 1.9, 0.05}}, {"intensity", {10, 9.4, 8.4}}});
  scene.medium = {ConstantBox{kAir, 1}, kAir, 0.5, 0.8, 0.0};
  return scene;
}

TalkScene no_walls_scene() {
  TalkScene scene{.camera = ground_camera(), .medium = {}};
  scene.meshes = {ground(0.3)};
  scene.lights.push_back({{"type", "directional"},
                          {"direction", json_list(Vec3d(0.45, -1, -0.3).normalized())},
                          {"irradiance", {3.2, 3.0, 2.7}}});
  // They are gone where the grid ends.
  const GaussianSum clouds{0,
                           {{{0.45, 0.75, -0.35}, 1.3, 0.33},
                            {{-0.7, 0.55, 0.45}, 1.0, 0.24},
                            {{0.15, 1.2, 0.75}, 0.9, 0.28}}};
  scene.medium = {clouds, kAir, 2.5, 0.95, 0.2};
  return scene;
}

}  // namespace brume
