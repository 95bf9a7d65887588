#include "geom/triangle_mesh.h"

#include <gtest/gtest.h>

namespace brume {
namespace {

TriangleMesh good_and_bad() {
  TriangleMesh mesh;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {nan, 0, 0}, {2, 0, 0}, {kInfinity, 1, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 1, 99}, {0, 1, 3}, {0, 1, 4}, {1, 1, 2}, {0, 2, 5}, {2, 1, 0}};
  mesh.materials = {0, 1, 2, 3, 4, 5, 6};
  return mesh;
}

TEST(TriangleMesh, DropsBadTrianglesAndTheirMaterials) {
  TriangleMesh mesh = good_and_bad();
  EXPECT_EQ(remove_bad_triangles(mesh), 5u);
  EXPECT_EQ(mesh.triangles, (std::vector<std::array<std::uint32_t, 3>>{{{0, 1, 2}}, {{2, 1, 0}}}));
  EXPECT_EQ(mesh.materials, (std::vector<std::uint32_t>{0, 6}));
}

TEST(TriangleMesh, KeepsSmallAndThinTriangles) {
  TriangleMesh mesh;
  mesh.positions = {{0, 0, 0}, {1e-9, 0, 0}, {0, 1e-9, 0}, {1e6, 0, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 3, 4}};
  EXPECT_EQ(remove_bad_triangles(mesh), 0u);
  EXPECT_EQ(mesh.triangles.size(), 2u);
}

}  // namespace
}  // namespace brume
