#include "vdb_media/point_writer.h"

#include <openvdb/points/PointAttribute.h>
#include <openvdb/points/PointConversion.h>

#include "core/error.h"
#include "vdb_archive.h"

namespace brume {
namespace {

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
