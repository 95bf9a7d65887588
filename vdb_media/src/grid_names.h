// Which grid of a file a request means. Pure text: no file is opened here.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "vdb_media/grid_file.h"

namespace brume {

// One grid of a file, as far as its directory tells.
struct GridEntry {
  std::string name;  // As its author named it; several may share one.
  std::string type;  // "float", "vec3s", ...
  bool is_level_set = false;
};

// `name`, or `name[i]` where several entries share the name.
std::string display_name(const std::vector<GridEntry>& entries, std::size_t index);
// `density (float), vel (vec3s)`: for messages; long lists are cut.
std::string list_names(const std::vector<GridEntry>& entries);

// A vector grid of a usual name for velocity.
bool is_velocity(const GridEntry& entry);
// The role whose usual names hold this one.
std::optional<GridRole> usual_role(const std::string& name);

// The entry that `request` means; nothing where an optional grid is not there. Throws
// Error(InvalidInput) that starts with `file` and lists what there is.
std::optional<std::size_t> choose_grid(const std::string& file,
                                       const std::vector<GridEntry>& entries,
                                       const GridRequest& request);

}  // namespace brume
