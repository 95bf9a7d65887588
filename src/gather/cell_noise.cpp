#include "gather/cell_noise.h"

#include <algorithm>

namespace brume {
namespace {

// Edges are noise to the plane, but a lattice of samples adds them up better than independent
// samples would: the part of the variance that remains, over twelve scenes (docs/decisions/0011).
constexpr double kOfLattices = 0.67;

}  // namespace

CellNoise::CellNoise(const DirectionCells& cells) {
  std::vector<std::vector<int>> around(static_cast<std::size_t>(cells.count()));
  const auto add = [&](int a, int b) {
    std::vector<int>& known = around[static_cast<std::size_t>(a)];
    if (a != b && std::find(known.begin(), known.end(), b) == known.end()) known.push_back(b);
  };
  for (const CellWall& wall : cells.walls()) {
    add(wall.low, wall.high);
    add(wall.high, wall.low);
  }
  for (const std::vector<int>& cell : around) {
    begin_.push_back(static_cast<int>(neighbours_.size()));
    neighbours_.insert(neighbours_.end(), cell.begin(), cell.end());
  }
  begin_.push_back(static_cast<int>(neighbours_.size()));
}

double CellNoise::variance(const DirectionCells& cells, std::span<const Vec3d> directions,
                           std::span<const double> values) const {
  double sum = 0;
  for (std::size_t c = 0; c < values.size(); ++c) {
    // Sums over the cell, which lies at the origin and has value 0, and its neighbours.
    const Frame frame(directions[c]);
    double x = 0, y = 0, z = 0, xx = 0, xy = 0, yy = 0, xz = 0, yz = 0;
    const int n = begin_[c + 1] - begin_[c] + 1;
    for (int i = begin_[c]; i < begin_[c + 1]; ++i) {
      const std::size_t o = static_cast<std::size_t>(neighbours_[static_cast<std::size_t>(i)]);
      const double u = directions[o].dot(frame.u), v = directions[o].dot(frame.v);
      const double d = values[o] - values[c];
      x += u, y += v, z += d;
      xx += u * u, xy += u * v, yy += v * v;
      xz += u * d, yz += v * d;
    }
    // About the mean.
    xx -= x * x / n, xy -= x * y / n, yy -= y * y / n;
    xz -= x * z / n, yz -= y * z / n;
    double expected = z / n, leverage = 1.0 / n;  // Of the cell itself, by the plane.
    const double determinant = xx * yy - xy * xy;
    if (n > 3 && determinant > 1e-6 * xx * yy) {
      const double along_x = (xz * yy - yz * xy) / determinant;
      const double along_y = (yz * xx - xz * xy) / determinant;
      expected -= (along_x * x + along_y * y) / n;
      leverage += (x * x * yy - 2 * x * y * xy + y * y * xx) / (determinant * n * n);
    }
    const double g = cells.cell(static_cast<int>(c)).measure;
    if (leverage < 0.99) sum += g * g * expected * expected / (1 - leverage);
  }
  return kOfLattices * sum;
}

}  // namespace brume
