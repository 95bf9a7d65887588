// Grids made in memory from a function of space.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "vdb_media/brick_grid.h"

namespace brume::test {

// `f` at the nodes of a lattice that fills `box`.
inline std::shared_ptr<const BrickGrid> dense_grid(const Box3d& box, int nodes,
                                                   const std::function<double(const Vec3d&)>& f) {
  Affine3d to_world;
  const Vec3d h = (box.max - box.min) / (nodes - 1);
  for (int a = 0; a < 3; ++a) {
    to_world.m[a][a] = h[a];
    to_world.m[a][3] = box.min[a];
  }
  std::vector<float> values;
  for (int z = 0; z < nodes; ++z)
    for (int y = 0; y < nodes; ++y)
      for (int x = 0; x < nodes; ++x)
        values.push_back(static_cast<float>(f(to_world.point(Vec3d(x, y, z)))));
  return BrickGrid::from_dense(Vec3i(0), Vec3i(nodes), values, to_world);
}

}  // namespace brume::test
