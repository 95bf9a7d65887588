// Reads OpenVDB files. Runs in the loader child only: OpenVDB crashes, hangs or eats all memory on
// some damaged files (DESIGN 4.9).
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "grid_blob.h"
#include "grid_names.h"
#include "vdb_media/grid_file.h"

namespace brume {

// Throws Error(InvalidInput) for whatever is wrong with the file, naming it by `shown_as` and the
// grid; std::bad_alloc where memory runs out.
class VdbReader {
 public:
  // Told what is about to be parsed, as `FILE: grid NAME`.
  using Trail = std::function<void(const std::string& place)>;

  VdbReader(const std::string& path, const std::string& shown_as, const GridFileOptions& options,
            Trail trail);
  ~VdbReader();

  // In order of name, those of one name in file order.
  const std::vector<GridEntry>& entries() const;
  LoadedArrays load(std::size_t entry, GridRole role) const;
  GridInfo inspect(std::size_t entry) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace brume
