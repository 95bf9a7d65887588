// main() of every test program: also the child that parses VDB files, as in the real program.
#include <gtest/gtest.h>

#include "core/parallel.h"
#include "vdb_media/grid_file.h"

int main(int argc, char** argv) {
  if (const auto status = brume::run_grid_loader_child(argc, argv)) return *status;
  brume::flush_denormals();
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
