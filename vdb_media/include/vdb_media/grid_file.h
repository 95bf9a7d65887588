// Reads grids from OpenVDB files that nobody vouches for.
//
// The file is parsed in a child process with limits on memory, CPU and wall clock (DESIGN 4.9), which
// hands back checked bricks; whatever the file holds, this process neither crashes nor swells. Every
// row of SPEC's "VDB input" table is decided here.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/math.h"
#include "vdb_media/brick_grid.h"

namespace brume {

enum class BadVoxelPolicy { Zero, Clamp, Error };  // --on-bad-voxels
enum class BackgroundPolicy { Error, Zero, Keep };  // --background

// What a medium reads a grid as. Each role has an ordered list of usual names, matched without case.
enum class GridRole { Density, Temperature, Flame, Emission, Color };
const std::vector<std::string>& usual_grid_names(GridRole role);
const char* grid_role_name(GridRole role);

struct GridFileOptions {
  BadVoxelPolicy on_bad_voxels = BadVoxelPolicy::Zero;
  BackgroundPolicy background = BackgroundPolicy::Error;
  std::uint64_t memory_limit_bytes = 0;  // Of the child; 0: half of what this machine may use.
  std::uint64_t max_voxels = 1ull << 33;
  double timeout_s = 60;  // Wall clock; the CPU limit follows from it.
};

// One grid as `inspect` shows it.
struct GridInfo {
  std::string name, type, grid_class, transform, compression;
  bool saved_as_half = false;
  std::uint64_t active_voxels = 0, active_tiles = 0;
  double min = 0, max = 0, mean = 0, background = 0;  // Of the active values; vec3: of the length.
  Vec3d voxel_size{1.0};
  Vec3i index_min{0}, index_max{-1};
  Box3d world_bounds;  // Outer faces of the active voxels.
  std::uint64_t nan_voxels = 0, infinite_voxels = 0, negative_voxels = 0;
  std::optional<GridRole> role;  // What it would be used as.
  // A density_scale that gives the grid an optical depth of about 3 across; 0 where it makes no sense.
  double proposed_density_scale = 0;
};

struct GridFileInfo {
  std::vector<GridInfo> grids;
  std::vector<std::string> warnings;
};

// Bad voxels by kind, as found and replaced while loading.
struct BadVoxels {
  std::uint64_t nan = 0, infinite = 0, negative = 0;
  std::uint64_t total() const { return nan + infinite + negative; }
};

struct LoadedGrid {
  std::string name;  // As in the file, printable.
  // One grid for scalars, three (x, y, z of a vec3) for colours.
  std::vector<std::shared_ptr<const BrickGrid>> channels;
  BadVoxels bad_voxels;
  std::vector<std::string> warnings;  // One line each, naming file and grid.
};

// `name` may be `name` or, where several grids share it, `name[i]` with i from 0 in file order.
struct GridRequest {
  GridRole role = GridRole::Density;
  std::optional<std::string> name;  // None: the usual names of the role, in order.
  bool required = true;             // Not required and not in the file: no grid, no error.
};

// One entry a request, in order; nothing where an optional grid is not there. Throws
// Error(InvalidInput) naming file and grid, Error(Resource) where the child could not be started.
std::vector<std::optional<LoadedGrid>> load_grids(const std::filesystem::path& file,
                                                  const std::vector<GridRequest>& requests,
                                                  const GridFileOptions& options);

GridFileInfo inspect_grid_file(const std::filesystem::path& file, const GridFileOptions& options);

// The child's side. A program that loads grids calls this first thing in main() and, where it returns
// a value, exits with it: the child is the same binary, started with a private argument.
std::optional<int> run_grid_loader_child(int argc, char** argv);

}  // namespace brume
