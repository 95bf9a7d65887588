// What a cache file holds: header, counts, bounds and histograms; single records; who answers at a point.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <utility>

#include "cli/command.h"
#include "core/math.h"

namespace brume {

struct InspectCacheOptions {
  std::optional<std::pair<std::size_t, std::size_t>> records;  // A:B, lists records [A, B).
  std::optional<Vec3d> at;  // Lists who answers there, with which weights.
  // Of `at`; default: of the nearest record of the layer.
  std::optional<Vec3d> normal;
  std::optional<int> layer;  // Of `at`; default: the one that answers eye rays, the highest.
  double min_radius = 0;     // Of `at`.
  // Goes on after bad records and says what precedes the damage of a damaged file.
  bool deep = false;
};

// Returns 0. Throws Error(InvalidInput) with the one-line reason for a file that is missing, damaged,
// unfinished or no cache; with `deep`, after what precedes the damage was printed.
int inspect_cache(const std::filesystem::path& file, const InspectCacheOptions& options,
                  CommandContext& context);

}  // namespace brume
