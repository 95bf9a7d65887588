// What a loaded scene holds, for `scene info`.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <ostream>

#include "scene/scene.h"

namespace brume {

struct SceneSummary {
  std::size_t triangles = 0;
  std::size_t mesh_lights = 0;  // Emissive materials that are sampled directly and in use.
};
SceneSummary summarize(const Scene& scene);

nlohmann::ordered_json summary_json(const Scene& scene);
// The same, indented text.
void write_summary_text(std::ostream& out, const nlohmann::ordered_json& summary);

// Optical depth (green) along the x, y and z extent of the volume's box, averaged over the box's
// cross section; infinite for an unbounded volume, 0 for an empty one.
Vec3d mean_optical_depth(const Volume& volume);

}  // namespace brume
