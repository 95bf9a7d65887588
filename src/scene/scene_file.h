// Reads scene files: JSON with // comments, strict (SPEC, "Scene file").
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace brume {

struct SceneFileOptions {
  std::vector<std::string> overrides;  // "/json/pointer=value", applied in order (-D).
  GridFileOptions grids;
  std::optional<int> frame;                     // For #### in file names.
  std::optional<std::filesystem::path> confine;  // Refuse what leaves this folder.
  std::uint64_t max_triangles = 200'000'000;
  // false: check the file alone. No mesh or grid is opened: `meshes` stays empty, volumes of .vdb files
  // have no density.
  bool load_data = true;
};

// Throws Error(InvalidInput): `FILE: /json/pointer: what is wrong: what to do`.
Scene load_scene(const std::filesystem::path& file, const SceneFileOptions& options);

// A scene around a bare .vdb: camera, sun and sky, ground plane chosen from its bounds; what was chosen
// is in `warnings`' sibling `notes`, one line each.
struct VdbScene {
  Scene scene;
  std::vector<std::string> notes;
};
VdbScene make_vdb_scene(const std::filesystem::path& vdb, const SceneFileOptions& options);

// JSON Schema (draft 2020-12) made from the table that parses, so the two cannot differ.
std::string scene_schema();
// docs/scene_format.md, made from the same table.
std::string scene_format_page();
// The example on that page: a scene that uses most keys.
std::string scene_example();

}  // namespace brume
