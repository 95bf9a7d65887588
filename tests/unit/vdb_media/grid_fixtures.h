// Small VDB files for tests, in a folder that goes away with the test.
#pragma once

#include <gtest/gtest.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "core/error.h"
#include "vdb_media/grid_file.h"
#include "vdb_media/grid_writer.h"

namespace brume {

class TempDir {
 public:
  TempDir() {
    std::string name = (std::filesystem::temp_directory_path() / "brume-test-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = name;
  }
  ~TempDir() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TempDir(const TempDir&) = delete;
  TempDir& operator=(const TempDir&) = delete;
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

inline std::string read_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline void write_file(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
}

inline Affine3d scaling(double s, const Vec3d& t = Vec3d(0.0)) {
  Affine3d a;
  a.m = {{{s, 0, 0, t.x}, {0, s, 0, t.y}, {0, 0, s, t.z}}};
  return a;
}

// A soft ball of `radius` voxels around the origin of index space, 1 in the middle.
inline GridToWrite ball_grid(int radius, const std::string& name = "density") {
  GridToWrite g;
  g.name = name;
  g.first = Vec3i(-radius);
  g.count = Vec3i(2 * radius + 1);
  for (int z = -radius; z <= radius; ++z)
    for (int y = -radius; y <= radius; ++y)
      for (int x = -radius; x <= radius; ++x)
        g.values.push_back(std::max(0.0f, 1 - std::sqrt(float(x * x + y * y + z * z)) / radius));
  g.index_to_world = scaling(0.1);
  return g;
}

inline GridToWrite block_grid(const Vec3i& first, const Vec3i& count, float value,
                              const std::string& name = "density") {
  GridToWrite g;
  g.name = name;
  g.first = first;
  g.count = count;
  g.values.assign(std::size_t(count.x) * count.y * count.z, value);
  g.index_to_world = scaling(0.1);
  return g;
}

inline std::vector<std::optional<LoadedGrid>> load_list(const std::filesystem::path& file,
                                                        const std::vector<GridRequest>& requests,
                                                        const GridFileOptions& options = {}) {
  return load_grids(file, requests, options);
}

inline LoadedGrid load_density(const std::filesystem::path& file,
                               const GridFileOptions& options = {}) {
  return load_grids(file, {GridRequest{}}, options).at(0).value();
}

// Runs `f`, which must throw an Error of one line, and returns it.
template <typename F>
Error error_of(F f) {
  try {
    f();
  } catch (const Error& e) {
    EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
    return e;
  }
  ADD_FAILURE() << "nothing was thrown";
  return Error(ErrorKind::Internal, "");
}

inline Error load_error(const std::filesystem::path& file, const GridRequest& request = {},
                        const GridFileOptions& options = {}) {
  return error_of([&] { load_grids(file, {request}, options); });
}

inline float node(const BrickGrid& grid, const Vec3i& p) { return grid.sample(Vec3d(p)); }

}  // namespace brume
