#include "scene/scene.h"

#include "core/error.h"
#include "scene/scene_check.h"

namespace brume {

const Camera& Scene::find_camera(const std::string& name) const {
  const std::string where = printable(file.string()) + ": /cameras: ";
  if (name.empty()) {
    if (camera) return *camera;
    if (!cameras.empty()) return cameras.begin()->second;
    throw Error(ErrorKind::InvalidInput,
                where + "the scene has no camera: add \"camera\" with position and look_at");
  }
  if (const auto it = cameras.find(name); it != cameras.end()) return it->second;
  std::vector<std::string> names;
  for (const auto& [known, unused] : cameras) names.push_back(known);
  std::string list;
  for (const std::string& known : names) list += (list.empty() ? "" : ", ") + printable(known);
  throw Error(ErrorKind::InvalidInput, where + "no camera is named \"" + printable(name) +
                                           "\"; named are " + (list.empty() ? "none" : list) +
                                           ": " + name_hint(name, names));
}

}  // namespace brume
