// Writes OpenVDB files: for data_gen, tests and exports. The files are ours, so this runs in process.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/math.h"

namespace brume {

// A dense block of float (or vec3) nodes to be written as one grid; nodes of value 0
// or of the background become inactive.
struct GridToWrite {
  std::string name = "density";
  Vec3i first{0};                // Index of the first node.
  Vec3i count{0};                // Nodes along each axis.
  std::vector<float> values;     // x fastest; for vec3 three floats a node.
  bool is_vec3 = false;
  Affine3d index_to_world;
  float background = 0;
  bool is_level_set = false;
  bool save_as_half = false;
};

// Written aside and renamed; the bytes depend on the arguments alone. Returns warnings, one line each
// (values too small for half floats). Throws Error(Resource) where it cannot write, and
// Error(InvalidInput) for grids that no file holds: sizes that disagree, a singular transform, values
// too large for half floats.
std::vector<std::string> write_grids(const std::filesystem::path& file, const std::vector<GridToWrite>& grids);

}  // namespace brume
