// The one place that writes .vdb files: grids and points share their transform and their archive.
#include <openvdb/openvdb.h>
#include <openvdb/points/PointAttribute.h>
#include <openvdb/points/PointConversion.h>
#include <openvdb/tools/Prune.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "stamped_archive.h"
#include "vdb_media/grid_writer.h"
#include "vdb_media/point_writer.h"

namespace brume {
namespace {

openvdb::math::Transform::Ptr to_transform(const Affine3d& a) {
  openvdb::math::Mat4d m = openvdb::math::Mat4d::identity();  // Acts on row vectors.
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) m(j, i) = a.m[std::size_t(i)][std::size_t(j)];
  return openvdb::math::Transform::createLinearTransform(m);
}

void write_archive(const std::filesystem::path& file, const openvdb::GridPtrVec& grids) {
  try {
    write_stamped_archive(file, [&](const std::string& path) {
      openvdb::io::File archive(path);
      archive.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
      archive.write(grids);
      archive.close();
    });
  } catch (const openvdb::Exception& e) {
    throw Error(ErrorKind::Resource, file.string() + ": cannot be written: " + printable(e.what()));
  }
}

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

namespace points = openvdb::points;

// Half of what OpenVDB can index, so that neighbours can be indexed too.
constexpr double kLargestIndex = 1 << 30;

openvdb::Vec3d converted(const Vec3d& v) { return {v.x, v.y, v.z}; }
openvdb::Vec3f converted(const Vec3f& v) { return {v.x, v.y, v.z}; }
template <typename T>
T converted(T number) {
  return number;
}

template <typename T>
auto converted(const std::vector<T>& values) {
  std::vector<decltype(converted(values.front()))> result;
  result.reserve(values.size());
  for (const T& value : values) result.push_back(converted(value));
  return result;
}

// Points of a surface fill about (diagonal / voxel)^2 voxels.
double fitting_voxel_size(const std::vector<Vec3d>& positions) {
  constexpr double kPointsPerVoxel = 4;
  Box3d box;
  for (const Vec3d& p : positions) box.extendBy(p);
  const double diagonal = positions.empty() ? 0 : (box.max - box.min).length();
  const double size =
      diagonal / std::sqrt(std::max(1.0, static_cast<double>(positions.size()) / kPointsPerVoxel));
  return size > 0 ? size : 1;
}

void check_reach(const std::filesystem::path& file, const std::vector<Vec3d>& positions,
                 double voxel_size) {
  for (const Vec3d& p : positions)
    for (int a = 0; a < 3; ++a)
      if (!(std::abs(p[a] / voxel_size) < kLargestIndex))
        throw Error(ErrorKind::InvalidInput,
                    printable(file.string()) +
                        ": its points lie too close together, too far from the origin, for "
                        "OpenVDB's indices: move the scene to the origin");
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

void write_points(const std::filesystem::path& file, const PointsToWrite& given) {
  openvdb::initialize();
  const double voxel_size = fitting_voxel_size(given.positions);
  check_reach(file, given.positions, voxel_size);
  const auto transform = openvdb::math::Transform::createLinearTransform(voxel_size);
  const std::vector<openvdb::Vec3d> positions = converted(given.positions);
  const points::PointAttributeVector<openvdb::Vec3d> wrapped(positions);
  const auto index =
      openvdb::tools::createPointIndexGrid<openvdb::tools::PointIndexGrid>(wrapped, *transform);
  const auto grid = points::createPointDataGrid<points::NullCodec, points::PointDataGrid>(
      *index, wrapped, *transform);
  auto& tree = grid->tree();
  for (const PointAttribute& attribute : given.attributes)
    std::visit(
        [&](const auto& given_values) {
          const auto values = converted(given_values);
          using Value = typename decltype(values)::value_type;
          points::appendAttribute<Value>(tree, attribute.name);
          const points::PointAttributeVector<Value> wrapped_values(values);
          points::populateAttribute<points::PointDataTree, openvdb::tools::PointIndexTree,
                                    points::PointAttributeVector<Value>>(
              tree, index->tree(), attribute.name, wrapped_values);
        },
        attribute.values);
  grid->setName(given.name);
  write_archive(file, {grid});
}

void write_voxels(const std::filesystem::path& file, const std::vector<VoxelsToWrite>& grids) {
  openvdb::initialize();
  openvdb::GridPtrVec written;
  for (const VoxelsToWrite& given : grids)
    std::visit(
        [&](const auto& values) {
          using Value = decltype(converted(values.front()));
          using Tree = typename openvdb::tree::Tree4<Value, 5, 4, 3>::Type;
          const auto grid = openvdb::Grid<Tree>::create();
          auto accessor = grid->getAccessor();
          for (std::size_t i = 0; i < given.voxels.size(); ++i) {
            const Vec3i& at = given.voxels[i];
            accessor.setValueOn({at.x, at.y, at.z}, converted(values[i]));
          }
          grid->setName(given.name);
          grid->setTransform(openvdb::math::Transform::createLinearTransform(given.voxel_size));
          grid->setGridClass(openvdb::GRID_FOG_VOLUME);
          written.push_back(grid);
        },
        given.values);
  write_archive(file, written);
}

}  // namespace brume
