// Small scenes whose irradiance and gradient at bare points are known to many digits: by quadrature
// with every discontinuity located analytically, or in closed form.
//
// Everything is black but the emitters, one channel is meant (all three are equal), lengths are
// metres. Receivers are points that face +z; no mesh stands for them. The room's walls are seen but
// cast no shadow, because one of the lights is outside.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/math.h"
#include "data_gen/analytic_field.h"
#include "scene/scene.h"

namespace brume {

// Radiates on the side of edge_u x edge_v.
struct OracleEmitter {
  Vec3d corner{0.0}, edge_u{1.0, 0.0, 0.0}, edge_v{0.0, 1.0, 0.0};
  double radiance = 1;  // [W/(m^2 sr)]
  std::optional<EmissionLobe> lobe{};
};

// sigma_t is `sigma_t` itself [1/m]; a sum without bumps is homogeneous and fills
// all space (the way from a light outside the room is dimmed too); a grid ends at the room.
struct OracleMedium {
  GaussianSum sigma_t;
  double albedo = 0;    // sigma_s / sigma_t.
  double emission = 0;  // Radiance per length over sigma_t [W/(m^2 sr)].
  double anisotropy = 0;
  // Node distance of the grid that holds a Gaussian medium. Where the case itself is defined on a
  // grid it is fixed; else it approximates the smooth field, with an error of order step^2.
  double grid_step = 0.05;
  bool is_grid_fixed = false;

  bool is_homogeneous() const { return sigma_t.bumps.empty(); }
};

struct OracleScene {
  std::string name;
  std::vector<OracleEmitter> emitters{};
  std::vector<Box3d> blocks{};  // Black, opaque, casting shadows.
  bool has_room = false;        // oracle_room()'s walls and ceiling; no floor.
  std::optional<OracleMedium> medium{};
  std::optional<PointLight> light{};
};

Box3d oracle_room();
// All of them, in a fixed order. `grid_step` goes to the media whose grid is not fixed.
std::vector<OracleScene> oracle_scenes(double grid_step = 0.05);
// One that no scene file can express: an emitter with a lobe, as a glossy reflector would send.
OracleScene glossy_oracle_scene();
// By name; throws Error(InvalidInput) listing the names there are.
OracleScene oracle_scene(const std::string& name, double grid_step = 0.05);

// A receiver facing +z, and what is known there [W/m^2, W/m^3].
struct OracleCase {
  std::string scene;
  Vec3d position{0.0};
  double irradiance = 0;
  Vec3d gradient{0.0};
  bool has_normal_gradient = false;  // gradient.z is known.
};
const std::vector<OracleCase>& oracle_cases();

// As a loaded scene file would be: bounces 0, volume_bounces 1.
Scene make_scene(const OracleScene& oracle);
// Writes NAME.json, NAME.obj and, for Gaussian media, NAME.vdb; returns the files, scene first.
std::vector<std::filesystem::path> write_oracle_scene(const OracleScene& oracle,
                                                      const std::filesystem::path& folder);

}  // namespace brume
