// What a cache file holds: header, counts, bounds and histograms; single records; who answers at a
// point.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <utility>

#include "cli/command.h"
#include "cli/shared_options.h"
#include "core/math.h"

namespace brume {

struct InspectCacheOptions {
  std::optional<std::pair<std::size_t, std::size_t>> records;  // A:B, lists records [A, B).
  std::optional<Vec3d> at;  // Lists who answers there, with which weights.
  // Of `at`; default: of the nearest record of the layer.
  std::optional<Vec3d> normal;
  std::optional<int> layer;  // Of `at`; default: the one that answers eye rays, the highest.
  double min_radius = 0;     // Of `at`: its footprint.
  // Goes on after bad records and says what precedes the damage of a damaged file.
  bool deep = false;
  std::filesystem::path html;      // Also writes a page that shows the records; empty: none.
  std::filesystem::path three_js;  // Of the page; empty: the system's.
};

// Returns 0. Throws Error(InvalidInput) with the one-line reason for a file that is missing,
// damaged, unfinished or no cache; with `deep`, after what precedes the damage was printed.
// `scene`, where it names a file, gives the page its surfaces, and `at` what hides records from it:
// then exactly the records are listed that a picture uses there.
int inspect_cache(const std::filesystem::path& file, const InspectCacheOptions& options,
                  const SceneOptions& scene, CommandContext& context);

}  // namespace brume
