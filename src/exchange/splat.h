// Records spread over voxels: a volume that any volume tool shows.
#pragma once

#include <cstddef>
#include <filesystem>

#include "cache/cache_file.h"

namespace brume {

struct SplatOptions {
  double voxel_size = 0;  // World units; positive.
  // In the boxes around all discs, so that a slip of --voxel ends at once.
  double max_visited_voxels = 5e8;
};

struct SplatResult {
  std::size_t voxels = 0;
};

// Grids "irradiance" (vector, [W/m^2]), "weight" and "count" (floats) of the voxels that discs of
// records cross. At a voxel's centre p, brought into the disc's plane as p', a record has the
// weight w = 1 - sqrt((d.e1/r1)^2 + (d.e2/r2)^2), d = p' - x, and the value E + gradient . d kept
// in [0, 2 E]: irradiance is the weighted mean, weight the sum of w and count how many had w > 0.
// The voxel that holds the record's place counts as at its centre, so that no record is lost
// between voxels. Throws Error(InvalidInput) where the discs would cross more than max_voxels
// voxels.
SplatResult write_splat(const std::filesystem::path& file, const CacheContents& contents,
                        const SplatOptions& options);

}  // namespace brume
