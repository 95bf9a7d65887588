#include "vdb_media/grid_writer.h"

#include <openvdb/tools/Prune.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "vdb_archive.h"

namespace brume {
namespace {

namespace fs = std::filesystem;

constexpr float kLargestHalf = 65504.0f, kSmallestHalf = 0x1p-24f;

void check(const fs::path& file, const GridToWrite& g) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ErrorKind::InvalidInput,
                file.string() + ": grid " + printable(g.name) + ": " + what);
  };
  std::uint64_t nodes = 1;
  for (int a = 0; a < 3; ++a) {
    if (g.count[a] < 0 || g.count[a] > (1 << 20)) refuse("its size is out of range");
    nodes *= static_cast<std::uint64_t>(g.count[a]);
  }
  if (g.values.size() != nodes * (g.is_vec3 ? 3 : 1)) refuse("its size is not that of its values");
  if (!g.index_to_world.inverse()) refuse("its transform is singular");
  if (g.is_vec3 && g.is_level_set) refuse("a vector grid cannot be a level set");
  if (!g.save_as_half) return;
  for (const float v : g.values)
    if (std::isfinite(v) && std::abs(v) > kLargestHalf)
      refuse("a value of " + std::to_string(v) +
             " does not fit half floats (at most 65504): "
             "write it in full");
}

template <typename Grid, typename Read, typename IsActive>
typename Grid::Ptr make_grid(const GridToWrite& g, const typename Grid::ValueType& background,
                             Read read, IsActive is_active) {
  auto grid = Grid::create(background);
  auto accessor = grid->getAccessor();
  std::size_t n = 0;
  for (int z = 0; z < g.count.z; ++z)
    for (int y = 0; y < g.count.y; ++y)
      for (int x = 0; x < g.count.x; ++x, ++n) {
        const auto value = read(n);
        const openvdb::Coord at(g.first.x + x, g.first.y + y, g.first.z + z);
        if (is_active(value)) {
          accessor.setValueOn(at, value);
        } else if (value != background) {
          accessor.setValueOff(at, value);
        }
      }
  // Constant regions become tiles, so that files stay small.
  openvdb::tools::prune(grid->tree());
  return grid;
}

openvdb::GridBase::Ptr to_openvdb(const GridToWrite& g) {
  openvdb::GridBase::Ptr grid;
  if (g.is_vec3) {
    grid = make_grid<openvdb::Vec3SGrid>(
        g, openvdb::Vec3f(g.background),
        [&](std::size_t n) {
          return openvdb::Vec3f(g.values[3 * n], g.values[3 * n + 1], g.values[3 * n + 2]);
        },
        [&](const openvdb::Vec3f& v) {
          return v != openvdb::Vec3f(0.0f) && v != openvdb::Vec3f(g.background);
        });
  } else {
    grid = make_grid<openvdb::FloatGrid>(
        g, g.background, [&](std::size_t n) { return g.values[n]; },
        [&](float v) {
          return g.is_level_set ? std::abs(v) < g.background : v != 0 && v != g.background;
        });
    grid->setGridClass(g.is_level_set ? openvdb::GRID_LEVEL_SET : openvdb::GRID_FOG_VOLUME);
  }
  grid->setName(g.name);
  grid->setTransform(to_transform(g.index_to_world));
  grid->setSaveFloatAsHalf(g.save_as_half);
  return grid;
}

}  // namespace

std::vector<std::string> write_grids(const fs::path& file, const std::vector<GridToWrite>& grids) {
  std::vector<std::string> warnings;
  for (const GridToWrite& g : grids) {
    check(file, g);
    const auto lost = std::count_if(g.values.begin(), g.values.end(), [](float v) {
      return v != 0 && std::abs(v) < kSmallestHalf / 2;
    });
    if (g.save_as_half && lost > 0)
      warnings.push_back(file.string() + ": grid " + printable(g.name) + ": " +
                         std::to_string(lost) + " values are too small for half floats: became 0");
  }
  openvdb::initialize();
  openvdb::GridPtrVec converted;
  for (const GridToWrite& g : grids) converted.push_back(to_openvdb(g));

  write_archive(file, converted);
  return warnings;
}

}  // namespace brume
