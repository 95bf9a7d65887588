// The parts that load_scene() is made of. Each takes checked views (scene_check.h) and asks what no
// table can know: what lies between keys, and what the named files hold.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "scene/scene_check.h"
#include "scene/scene_file.h"

namespace brume {

// What the parts share while one scene is read.
struct SceneLoad {
  const SceneDocument& document;
  const SceneFileOptions& options;
  std::filesystem::path folder;  // Paths are relative to it.
  Scene& scene;
  bool has_frame_numbers = false;  // An input's name holds ####.
};

// Adds the place to errors that know only a file: `SCENE: /meshes/0/file: room.obj: ...`.
template <typename F>
auto at_place(const SceneDocument& document, const std::string& pointer, F&& work) {
  try {
    return work();
  } catch (const Error& e) {
    throw Error(e.kind(), document.file() + ": " + printable(pointer) + ": " + e.what());
  }
}

// A path key's value with ${ENV} and #### expanded, made absolute by the scene's folder and
// confined. `text` stands at `pointer`. Throws Error(InvalidInput) for what can be no path.
std::filesystem::path resolve_path(SceneLoad& load, const std::string& pointer,
                                   const std::string& text, bool is_input);
inline std::filesystem::path resolve_input(SceneLoad& load, const ObjectView& view,
                                           std::string_view key) {
  return resolve_path(load, view.pointer(key), view.text(key), true);
}

// Fill scene.materials, scene.meshes, and with `include` also cameras and lights.
void load_surfaces(SceneLoad& load, const ObjectView& root);
void load_volumes(SceneLoad& load, const ObjectView& root);

// A whole scene from its text. `file` is named in messages; paths are relative to `folder`.
Scene load_scene_text(std::string_view text, const std::filesystem::path& file,
                      const std::filesystem::path& folder, const SceneFileOptions& options);

}  // namespace brume
