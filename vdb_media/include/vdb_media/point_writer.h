// Writes points with attributes, and single voxels, as OpenVDB files that Houdini and Blender open.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

#include "core/math.h"

namespace brume {

struct PointAttribute {
  std::string name;
  std::variant<std::vector<float>, std::vector<Vec3f>, std::vector<std::int32_t>> values;
};

// One PointDataGrid, in voxels of its own choice; attribute values are exact, positions to a
// 2^-24th of a voxel, which holds a few points of a surface.
struct PointsToWrite {
  std::string name = "points";
  std::vector<Vec3d> positions;  // World space.
  std::vector<PointAttribute> attributes;
};

// A grid with `values[i]` at `voxels[i]`, each named once, and 0 elsewhere. Voxel (i,j,k) is
// centred at voxel_size * (i,j,k).
struct VoxelsToWrite {
  std::string name;
  double voxel_size = 1;
  std::vector<Vec3i> voxels;
  std::variant<std::vector<float>, std::vector<Vec3f>> values;
};

// Both are written aside and renamed, and the bytes depend on the arguments alone. Throw
// Error(Resource) where they cannot write, and Error(InvalidInput) for points that OpenVDB's
// indices do not reach.
void write_points(const std::filesystem::path& file, const PointsToWrite& points);
void write_voxels(const std::filesystem::path& file, const std::vector<VoxelsToWrite>& grids);

}  // namespace brume
