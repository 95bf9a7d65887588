// What one cell of a gather sums over its shells.
#pragma once

#include <algorithm>
#include <functional>
#include <vector>

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

// Running sums over a cell's shells, so that each wall costs one look-up however many there are.
class ShellSums {
 public:
  void begin(int shells) {
    inverse_t_.clear();
    sums_.assign(1, {});
    inverse_t_.reserve(shells);
    sums_.reserve(shells + 1);
  }
  // The next shell outwards: its light and 1/t of its centre.
  void add(const RgbD& light, double inverse_t) {
    const Sums& s = sums_.back();
    sums_.push_back({s.light + light, s.over_distance + light * inverse_t});
    inverse_t_.push_back(inverse_t);
  }
  RgbD light() const { return sums_.back().light; }
  RgbD light_over_distance() const { return sums_.back().over_distance; }
  // sum F_i / min(t_i, r), from 1/r: Phi of gradients.md 3.
  RgbD over_distance_up_to(double inverse_r) const {
    const auto beyond =
        std::lower_bound(inverse_t_.begin(), inverse_t_.end(), inverse_r, std::greater<>());
    const Sums& near = sums_[beyond - inverse_t_.begin()];
    return near.over_distance + (sums_.back().light - near.light) * inverse_r;
  }

 private:
  struct Sums {
    RgbD light, over_distance;
  };
  std::vector<double> inverse_t_;  // Descending.
  std::vector<Sums> sums_;
};

}  // namespace brume
