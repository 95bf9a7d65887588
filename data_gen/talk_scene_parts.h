// What a scene of the talk is made of before it is written; private to data_gen.
#pragma once

#include <optional>
#include <vector>

#include "data_gen/analytic_field.h"
#include "data_gen/scene_text.h"
#include "data_gen/talk_scenes.h"

namespace brume {

// A mesh file of its own, of one material.
struct TalkMesh {
  std::string name;
  SceneJson material;  // As in "materials".
  TriangleMesh mesh{};
  bool casts_shadow = true;
};

struct TalkMedium {
  AnalyticField density;  // A ConstantBox becomes a homogeneous volume, anything else a grid.
  Box3d bounds;
  double sigma_t = 1;  // Extinction where the density is 1 [1/m].
  double albedo = 0, anisotropy = 0;
};

struct TalkScene {
  SceneJson camera;
  double aspect = 4.0 / 3;  // Width over height.
  std::vector<TalkMesh> meshes{};
  SceneJson lights = SceneJson::array();
  TalkMedium medium;
  int bounces = 1;
};

SceneJson camera_json(const Vec3d& position, const Vec3d& look_at, double fov_deg);
SceneJson diffuse(const Vec3d& albedo);

TalkScene absorbing_scene();
TalkScene scattering_scene();
TalkScene no_walls_scene();
TalkScene window_scene(const TalkSceneOptions& options);
TalkScene disco_scene(const TalkSceneOptions& options);

}  // namespace brume
