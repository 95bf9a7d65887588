#include "vdb_media/brick_pyramid.h"

#include <algorithm>
#include <array>

namespace brume {
namespace {

constexpr int kCells = BrickGrid::kCells, kNodes = BrickGrid::kNodes;
// Fine nodes that one coarse brick is made of, along an axis: two bricks and one more to each side.
constexpr int kFine = 2 * kCells + 3;
constexpr int kFewBricks = 2;  // Along each axis; nothing is gained from coarser levels.

int floor_half(int a) { return a >> 1; }

// One coarse brick at a time, out of up to 4^3 fine ones.
class Halver {
 public:
  explicit Halver(const BrickGrid& grid) : grid_(grid) {}

  // `brick` counts coarse bricks from index 0.
  void add(const Vec3i& brick, std::vector<std::int32_t>& top, std::vector<float>& bricks,
           std::vector<float>& tiles) {
    const Vec3i first = brick * (2 * kCells) - Vec3i(1);  // Fine node of fine_[0].
    if (!read(first)) {
      top.push_back(BrickGrid::kEmpty);
      return;
    }
    const auto [least, most] = std::minmax_element(fine_.begin(), fine_.end());
    if (*least == *most) {
      top.push_back(-2 - static_cast<std::int32_t>(tiles.size()));
      tiles.push_back(*least);
      return;
    }
    for (int row = 0; row < kFine * kFine; ++row)
      for (int x = 0; x < kNodes; ++x)
        along_x_[row * kNodes + x] = mean(&fine_[row * kFine + 2 * x], 1);
    for (int z = 0; z < kFine; ++z)
      for (int y = 0; y < kNodes; ++y)
        for (int x = 0; x < kNodes; ++x)
          along_y_[(z * kNodes + y) * kNodes + x] =
              mean(&along_x_[(z * kFine + 2 * y) * kNodes + x], kNodes);
    top.push_back(static_cast<std::int32_t>(bricks.size() / BrickGrid::kBrickFloats));
    for (int z = 0; z < kNodes; ++z)
      for (int i = 0; i < kNodes * kNodes; ++i)
        bricks.push_back(mean(&along_y_[2 * z * kNodes * kNodes + i], kNodes * kNodes));
  }

 private:
  static float mean(const float* of, int stride) {
    return 0.5f * of[stride] + 0.25f * (of[0] + of[2 * stride]);
  }

  // The nodes from `first` on into fine_; false where all of them are 0.
  bool read(const Vec3i& first) {
    bool any = false;
    Vec3i low, high;
    for (int a = 0; a < 3; ++a) {
      low[a] = first[a] >> 3;
      high[a] = (first[a] + kFine - 1) >> 3;
    }
    fine_.fill(0);
    for (int bz = low.z; bz <= high.z; ++bz)
      for (int by = low.y; by <= high.y; ++by)
        for (int bx = low.x; bx <= high.x; ++bx) any |= read_brick({bx, by, bz}, first);
    return any;
  }
  // Those that lie in one brick's cells, its last nodes included.
  bool read_brick(const Vec3i& brick, const Vec3i& first) {
    const Vec3i at = brick - grid_.brick_min(), count = grid_.brick_count();
    for (int a = 0; a < 3; ++a)
      if (at[a] < 0 || at[a] >= count[a]) return false;
    const std::int32_t entry = grid_.top(at);
    if (entry == BrickGrid::kEmpty) return false;
    const float* nodes = entry >= 0 ? grid_.brick(entry) : nullptr;
    const Vec3i corner = brick * kCells - first;  // Of the brick's first node in fine_.
    Vec3i begin, end;
    for (int a = 0; a < 3; ++a) {
      begin[a] = std::max(0, -corner[a]);
      end[a] = std::min(kNodes, kFine - corner[a]);
    }
    for (int z = begin.z; z < end.z; ++z)
      for (int y = begin.y; y < end.y; ++y) {
        float* row = &fine_[((corner.z + z) * kFine + corner.y + y) * kFine + corner.x];
        for (int x = begin.x; x < end.x; ++x)
          row[x] = nodes ? nodes[(z * kNodes + y) * kNodes + x] : grid_.tile(entry);
      }
    return true;
  }

  const BrickGrid& grid_;
  std::array<float, kFine * kFine * kFine> fine_;
  std::array<float, kFine * kFine * kNodes> along_x_;
  std::array<float, kFine * kNodes * kNodes> along_y_;
};

}  // namespace

std::shared_ptr<const BrickGrid> halved(const BrickGrid& grid) {
  // By where the field is, not by the bricks, which would never become fewer than three.
  Vec3i first(0), count(0);
  for (int a = 0; a < 3 && !grid.is_empty(); ++a) {
    const int low = static_cast<int>(grid.index_bounds().min[a]);
    const int high = static_cast<int>(grid.index_bounds().max[a]);
    // A node reaches one cell to either side.
    first[a] = (floor_half(low) - 1) >> 3;
    count[a] = (floor_half(high + 1) >> 3) - first[a] + 1;
  }
  std::vector<std::int32_t> top;
  std::vector<float> bricks, tiles;
  Halver halver(grid);
  for (int z = 0; z < count.z; ++z)
    for (int y = 0; y < count.y; ++y)
      for (int x = 0; x < count.x; ++x) halver.add(first + Vec3i(x, y, z), top, bricks, tiles);
  const Affine3d twice{{{{2, 0, 0, 0}, {0, 2, 0, 0}, {0, 0, 2, 0}}}};
  return std::make_shared<BrickGrid>(first, count, std::move(top), std::move(bricks),
                                     std::move(tiles), grid.index_to_world() * twice);
}

BrickPyramid::BrickPyramid(std::shared_ptr<const BrickGrid> grid) : levels_{std::move(grid)} {
  const auto is_small = [](const BrickGrid& g) {
    if (g.is_empty()) return true;
    for (int a = 0; a < 3; ++a)
      if (g.brick_count()[a] > kFewBricks) return false;
    return true;
  };
  while (!is_small(*levels_.back())) levels_.push_back(halved(*levels_.back()));
}

int BrickPyramid::level_for(double width) const {
  int l = 0;
  while (l + 1 < level_count() && level(l + 1).voxel_size() <= width) ++l;
  return l;
}

}  // namespace brume
