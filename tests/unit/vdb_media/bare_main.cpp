// A program that loads a grid although its main() does not provide for the loader child. It must be
// told so, and must not start a copy of itself.
#include <cstdio>
#include <string>

#include "core/error.h"
#include "vdb_media/grid_file.h"

int main() {
  try {
    brume::load_grids("any.vdb", {brume::GridRequest{}}, {});
  } catch (const brume::Error& e) {
    const bool told = std::string(e.what()).find("run_grid_loader_child") != std::string::npos;
    std::puts(e.what());
    return told && e.kind() == brume::ErrorKind::Resource ? 0 : 1;
  }
  return 1;
}
