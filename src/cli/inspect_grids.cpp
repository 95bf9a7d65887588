#include "cli/inspect_grids.h"

#include "cli/outputs.h"
#include "cli/text_table.h"
#include "core/error.h"

namespace brume {
namespace {

// An empty grid has no box, and JSON has no infinity.
Json bounds_json(const Box3d& box) {
  if (box.isEmpty() || !is_finite(box.min) || !is_finite(box.max)) return nullptr;
  return Json::array({json_of(box.min), json_of(box.max)});
}

Json grid_json(const GridInfo& grid) {
  Json object = Json::object();
  object["name"] = printable(grid.name);
  object["type"] = grid.type;
  object["class"] = grid.grid_class;
  object["role"] = grid.role ? Json(grid_role_name(*grid.role)) : Json(nullptr);
  object["transform"] = grid.transform;
  object["voxel_size"] = json_of(grid.voxel_size);
  object["index_bounds"] = {{grid.index_min.x, grid.index_min.y, grid.index_min.z},
                            {grid.index_max.x, grid.index_max.y, grid.index_max.z}};
  object["world_bounds"] = bounds_json(grid.world_bounds);
  object["active_voxels"] = grid.active_voxels;
  object["active_tiles"] = grid.active_tiles;
  object["min"] = grid.min;
  object["max"] = grid.max;
  object["mean"] = grid.mean;
  object["background"] = grid.background;
  object["bad_voxels"] = {{"nan", grid.nan_voxels},
                          {"infinite", grid.infinite_voxels},
                          {"negative", grid.negative_voxels}};
  object["saved_as_half"] = grid.saved_as_half;
  object["compression"] = grid.compression;
  object["proposed_density_scale"] = grid.proposed_density_scale;
  return object;
}

std::string shown_vector(const Vec3d& v) {
  return shown_number(v.x) + " " + shown_number(v.y) + " " + shown_number(v.z);
}

std::string shown_bad_voxels(const GridInfo& grid) {
  if (grid.nan_voxels + grid.infinite_voxels + grid.negative_voxels == 0) return "none";
  return std::to_string(grid.nan_voxels) + " NaN, " + std::to_string(grid.infinite_voxels) +
         " infinite, " + std::to_string(grid.negative_voxels) + " negative";
}

void print_grid(std::ostream& out, const GridInfo& grid) {
  const auto row = [&](const char* name, const std::string& value) {
    out << "  " << std::string(name) + std::string(16 - std::string(name).size(), ' ') << value
        << '\n';
  };
  out << printable(grid.name) << '\n';
  row("used as",
      grid.role ? grid_role_name(*grid.role) : "nothing (name it in the scene to use it)");
  row("type", grid.type + (grid.saved_as_half ? ", saved as half" : "") + ", " + grid.grid_class);
  row("transform", printable(grid.transform));
  row("voxel size", shown_vector(grid.voxel_size));
  row("active", std::to_string(grid.active_voxels) + " voxels, " +
                    std::to_string(grid.active_tiles) + " tiles");
  if (!grid.world_bounds.isEmpty())
    row("bounds",
        shown_vector(grid.world_bounds.min) + "  to  " + shown_vector(grid.world_bounds.max));
  row("values", shown_number(grid.min) + " to " + shown_number(grid.max) + ", mean " +
                    shown_number(grid.mean) + ", background " + shown_number(grid.background));
  row("bad voxels", shown_bad_voxels(grid));
  row("compression", grid.compression);
  if (grid.proposed_density_scale > 0)
    row("density_scale",
        shown_number(grid.proposed_density_scale) + " gives an optical depth of about 3 across");
}

}  // namespace

void inspect_grids(const std::filesystem::path& file, const GridFileOptions& options,
                   const CommandContext& context) {
  const GridFileInfo info = inspect_grid_file(file, options);
  for (const std::string& warning : info.warnings) context.warn(warning);
  if (context.json) {
    Json all = Json::object();
    all["grids"] = Json::array();
    for (const GridInfo& grid : info.grids) all["grids"].push_back(grid_json(grid));
    all["warnings"] = info.warnings;
    print_json(context, all);
    return;
  }
  context.out << printable(file.string()) << ": " << info.grids.size()
              << (info.grids.size() == 1 ? " grid\n" : " grids\n");
  for (const GridInfo& grid : info.grids) print_grid(context.out, grid);
}

}  // namespace brume
