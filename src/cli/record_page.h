// One self-contained page that shows records over the surfaces of their scene, in three dimensions.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cache/cache_file.h"
#include "scene/world.h"

namespace brume {

struct RecordPageOptions {
  std::string title;
  std::vector<std::pair<std::string, std::string>> facts;  // Shown as they are, name and text.
  const World* world = nullptr;  // Its surfaces lie below the records; null: none.
  std::optional<Camera> camera;
  Vec3d up{0.0, 1.0, 0.0};
  // three.js as a classic script; empty: where Debian's libjs-three has it.
  std::filesystem::path three_js;
  std::size_t max_records = 200'000;  // More are thinned evenly, as browsers have limits.
  std::size_t max_triangles = 1'000'000;
};

// Written aside and renamed; equal arguments give equal bytes. Returns warnings, one line each.
// Throws Error(InvalidInput) where three.js is not to be found, Error(Resource) where it cannot
// write.
std::vector<std::string> write_record_page(const std::filesystem::path& file,
                                           const CacheContents& contents,
                                           const RecordPageOptions& options);

}  // namespace brume
