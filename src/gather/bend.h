// What a cell sums over its medium, for the change of what lies in front.
#pragma once

#include "core/math.h"
#include "vdb_media/medium.h"

namespace brume {

// Of one cell and one grid: the sum of F_i times the density's gradient integral for a ray that
// ends in shell i, in the grid's index space.
struct Bend {
  int volume = 0;
  RgbGradient sum;

  void add(const RgbD& light, const Vec3d& integral) { sum += outer(light, integral); }
  // As an integral of grad sigma_t in world space.
  RgbGradient in_world(const Volume& v) const {
    const RgbD sigma_t = v.sigma_t();
    RgbGradient world;
    for (int ch = 0; ch < 3; ++ch)
      world[ch] = v.density->world_to_index().transposed_vector(sum[ch]) * sigma_t[ch];
    return world;
  }
};

}  // namespace brume
