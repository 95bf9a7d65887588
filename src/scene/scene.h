// What a scene file says, checked, as plain structs. World (world.h) makes it ready for rays.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/math.h"
#include "geom/triangle_mesh.h"
#include "scene/light.h"
#include "scene/material.h"
#include "vdb_media/grid_file.h"
#include "vdb_media/medium.h"

namespace brume {

struct Camera {
  Vec3d position{0.0, 0.0, 1.0}, look_at{0.0}, up{0.0, 1.0, 0.0};
  double fov_deg = 40;  // Vertical.
};

struct Film {
  int width = 640, height = 480;
};

// "render" of the scene file; each has a command line flag.
struct RenderSettings {
  int bounces = 4;
  // Nothing: auto. Until volume records exist auto is 1.
  std::optional<int> volume_bounces;
  std::uint64_t seed = 1;
  int cells_theta = 20, cells_phi = 64;
  int shells = 0;          // 0: automatic.
  double footprint = 1;
  int lamp_samples = 4;    // 0: all.
  double step_voxels = 0;  // 0: automatic.
};

enum class CacheMode { New, Append, Missing, Read };
struct CacheSettings {
  std::filesystem::path file;  // Empty: in memory.
  CacheMode mode = CacheMode::Missing;
};

struct OutputSettings {
  std::filesystem::path file;
  std::vector<std::string> aovs;  // Empty: all layers.
};

struct Scene {
  std::filesystem::path file;  // Where it came from, for messages.
  double unit = 1;             // Metres per scene unit.
  Vec3d up{0.0, 1.0, 0.0};
  std::optional<Camera> camera;
  std::map<std::string, Camera> cameras;
  Film film;
  std::vector<Material> materials;
  std::vector<TriangleMesh> meshes;  // World space; TriangleMesh::materials index `materials`.
  std::vector<LightDescription> lights;
  std::vector<Volume> volumes;  // Grids loaded.
  BadVoxels bad_voxels;
  std::vector<std::string> grids;  // "file: grid as role", for -v and image metadata.
  RenderSettings render;
  CacheSettings cache;
  std::vector<OutputSettings> outputs;
  std::vector<std::string> warnings;  // One line each; what importers dropped is here too.

  // By name; "" is the scene's own camera, else the only or first named one. Throws
  // Error(InvalidInput) listing the names there are.
  const Camera& find_camera(const std::string& name) const;
};

}  // namespace brume
