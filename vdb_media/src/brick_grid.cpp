#include "vdb_media/brick_grid.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>

#include "core/error.h"

namespace brume {
namespace {

constexpr int kCells = BrickGrid::kCells, kNodes = BrickGrid::kNodes;
// Beyond this an index and its neighbours no longer fit 32 bits with room to spare (HARD_CASES
// N13).
constexpr std::int64_t kMaxIndex = std::int64_t{1} << 30;

void require(bool ok, const char* what) {
  if (!ok) throw Error(ErrorKind::InvalidInput, std::string("grid: ") + what);
}

constexpr int floor_div(int a, int b) { return a / b - (a % b != 0 && (a < 0) != (b < 0)); }

struct Cell {
  Vec3i brick;  // Relative to brick_min.
  int offset;   // Of the cell's first node in the brick.
  float fx, fy, fz;
};

// The eight corners of a cell and the point in it as a polynomial: value and first derivatives.
template <typename T>
struct Trilinear {
  T value, dx, dy, dz;
};

template <typename T>
Trilinear<T> trilinear(const float* c, T fx, T fy, T fz) {
  constexpr int kY = kNodes, kZ = kNodes * kNodes;
  const T dx00 = T(c[1]) - T(c[0]), dx10 = T(c[kY + 1]) - T(c[kY]);
  const T dx01 = T(c[kZ + 1]) - T(c[kZ]), dx11 = T(c[kZ + kY + 1]) - T(c[kZ + kY]);
  const T v00 = T(c[0]) + fx * dx00, v10 = T(c[kY]) + fx * dx10;
  const T v01 = T(c[kZ]) + fx * dx01, v11 = T(c[kZ + kY]) + fx * dx11;
  const T dy0 = v10 - v00, dy1 = v11 - v01;
  const T v0 = v00 + fy * dy0, v1 = v01 + fy * dy1;
  const T x0 = dx00 + fy * (dx10 - dx00), x1 = dx01 + fy * (dx11 - dx01);
  return {v0 + fz * (v1 - v0), x0 + fz * (x1 - x0), dy0 + fz * (dy1 - dy0), v1 - v0};
}

}  // namespace

BrickGrid::BrickGrid(const Vec3i& brick_min, const Vec3i& brick_count,
                     std::vector<std::int32_t> top, std::vector<float> bricks,
                     std::vector<float> tiles, const Affine3d& index_to_world)
    : brick_min_(brick_min),
      brick_count_(brick_count),
      top_(std::move(top)),
      bricks_(std::make_shared<const std::vector<float>>(std::move(bricks))),
      brick_data_(bricks_->data()),
      tiles_(std::move(tiles)) {
  std::size_t positions = 1;
  for (int a = 0; a < 3; ++a) {
    require(brick_count_[a] >= 0, "negative number of bricks");
    require(std::int64_t{brick_min_[a]} * kCells >= -kMaxIndex &&
                (std::int64_t{brick_min_[a]} + brick_count_[a]) * kCells <= kMaxIndex,
            "index outside +-2^30: move or resample the grid");
    require(brick_count_[a] == 0 || positions <= (std::size_t{1} << 40) / brick_count_[a],
            "too many bricks");
    positions *= brick_count_[a];
  }
  require(top_.size() == positions, "size of the top level differs from its extent");
  require(bricks_->size() % kBrickFloats == 0, "brick values are not whole bricks");
  place(index_to_world);

  for (const float v : tiles_)
    require(v >= 0 && std::isfinite(v), "tile value negative or not finite");
  // Nodes that are not zero, per brick: they bound where the field can be.
  struct Extent {
    std::array<int, 3> first{kNodes, kNodes, kNodes}, last{-1, -1, -1};
  };
  const std::size_t bricks_held = bricks_->size() / kBrickFloats;
  brick_ranges_.resize(bricks_held);
  std::vector<Extent> extents(bricks_held);
  for (std::size_t b = 0; b < bricks_held; ++b) {
    const float* v = brick(std::int32_t(b));
    ValueRange r{v[0], v[0]};
    Extent& e = extents[b];
    for (int z = 0, i = 0; z < kNodes; ++z)
      for (int y = 0; y < kNodes; ++y)
        for (int x = 0; x < kNodes; ++x, ++i) {
          require(v[i] >= 0 && std::isfinite(v[i]), "value negative or not finite");
          r.min = std::min(r.min, v[i]);
          r.max = std::max(r.max, v[i]);
          if (v[i] == 0) continue;
          const std::array<int, 3> p{x, y, z};
          for (int a = 0; a < 3; ++a) {
            e.first[a] = std::min(e.first[a], p[a]);
            e.last[a] = std::max(e.last[a], p[a]);
          }
        }
    brick_ranges_[b] = r;
  }

  bool has_empty = false, first_value = true;
  std::size_t i = 0;
  for (int z = 0; z < brick_count_.z; ++z)
    for (int y = 0; y < brick_count_.y; ++y)
      for (int x = 0; x < brick_count_.x; ++x, ++i) {
        std::int32_t& entry = top_[i];
        require(entry < std::int32_t(bricks_held) &&
                    -2 - std::int64_t{entry} < std::int64_t(tiles_.size()),
                "brick or tile number out of range");
        const ValueRange r = brick_range(entry);
        // A brick of zeros is as good as none, and skipped faster.
        if (r.max == 0) entry = kEmpty;
        if (entry == kEmpty) {
          has_empty = true;
          continue;
        }
        ++top_count_;
        range_.min = first_value ? r.min : std::min(range_.min, r.min);
        range_.max = std::max(range_.max, r.max);
        first_value = false;
        const Vec3i cell = (brick_min_ + Vec3i(x, y, z)) * kCells;
        for (int a = 0; a < 3; ++a) {
          // A node reaches one cell to either side, but not out of this brick's cells.
          int lo = 0, hi = kCells;
          if (entry >= 0) {
            lo = std::max(0, extents[entry].first[a] - 1);
            hi = std::min(kCells, extents[entry].last[a] + 1);
          }
          index_bounds_.min[a] = std::min(index_bounds_.min[a], double(cell[a] + lo));
          index_bounds_.max[a] = std::max(index_bounds_.max[a], double(cell[a] + hi));
        }
      }
  if (has_empty) range_.min = 0;
}

void BrickGrid::place(const Affine3d& index_to_world) {
  index_to_world_ = index_to_world;
  const auto inverse = index_to_world_.inverse();
  require(inverse.has_value(), "transform is singular or not finite");
  world_to_index_ = *inverse;
  voxel_size_ = kInfinity;
  for (int a = 0; a < 3; ++a) {
    const Vec3d edge(index_to_world_.m[0][a], index_to_world_.m[1][a], index_to_world_.m[2][a]);
    voxel_size_ = std::min(voxel_size_, edge.length());
  }
  require(std::isfinite(voxel_size_) && voxel_size_ > 0, "voxel size is 0 or not finite");
}

std::shared_ptr<const BrickGrid> BrickGrid::with_transform(const Affine3d& index_to_world) const {
  auto moved = std::make_shared<BrickGrid>(*this);
  moved->place(index_to_world);
  return moved;
}

std::shared_ptr<const BrickGrid> BrickGrid::from_dense(const Vec3i& first, const Vec3i& count,
                                                       const std::vector<float>& values,
                                                       const Affine3d& index_to_world) {
  std::size_t nodes = 1;
  for (int a = 0; a < 3; ++a) {
    require(count[a] >= 0, "negative number of nodes");
    require(std::abs(std::int64_t{first[a]}) < kMaxIndex &&
                std::int64_t{first[a]} + count[a] < kMaxIndex,
            "index outside +-2^30: move or resample the grid");
    nodes *= std::size_t(count[a]);
  }
  require(values.size() == nodes, "number of values differs from the extent");
  if (nodes == 0)
    return std::make_shared<BrickGrid>(Vec3i(0), Vec3i(0), std::vector<std::int32_t>(),
                                       std::vector<float>(), std::vector<float>(), index_to_world);

  // Node n is a corner of the cells n - 1 and n.
  Vec3i brick_min, brick_count;
  for (int a = 0; a < 3; ++a) {
    brick_min[a] = floor_div(first[a] - 1, kCells);
    brick_count[a] = floor_div(first[a] + count[a] - 1, kCells) - brick_min[a] + 1;
  }
  std::vector<std::int32_t> top;
  std::vector<float> bricks, tiles;
  std::array<float, kBrickFloats> block;
  for (int bz = 0; bz < brick_count.z; ++bz)
    for (int by = 0; by < brick_count.y; ++by)
      for (int bx = 0; bx < brick_count.x; ++bx) {
        const Vec3i corner = (brick_min + Vec3i(bx, by, bz)) * kCells - first;
        block.fill(0);
        const int x_begin = std::max(0, -corner.x), x_end = std::min(kNodes, count.x - corner.x);
        for (int z = std::max(0, -corner.z); z < std::min(kNodes, count.z - corner.z); ++z)
          for (int y = std::max(0, -corner.y); y < std::min(kNodes, count.y - corner.y); ++y) {
            const std::size_t row =
                (std::size_t(corner.z + z) * count.y + (corner.y + y)) * count.x;
            for (int x = x_begin; x < x_end; ++x)
              block[(z * kNodes + y) * kNodes + x] = values[row + corner.x + x];
          }
        // NaN is unlike itself, so a brick of it stays a brick and the constructor refuses it.
        const bool constant =
            std::all_of(block.begin(), block.end(), [&](float v) { return v == block[0]; });
        if (constant && block[0] == 0) {
          top.push_back(kEmpty);
        } else if (constant) {
          top.push_back(-2 - std::int32_t(tiles.size()));
          tiles.push_back(block[0]);
        } else {
          top.push_back(std::int32_t(bricks.size() / kBrickFloats));
          bricks.insert(bricks.end(), block.begin(), block.end());
        }
      }
  return std::make_shared<BrickGrid>(brick_min, brick_count, std::move(top), std::move(bricks),
                                     std::move(tiles), index_to_world);
}

Box3d BrickGrid::world_bounds() const {
  return is_empty() ? Box3d() : index_to_world_.box(index_bounds_);
}

namespace {

// The cell that holds p, which lies in `bounds`, half-open; nothing outside or for NaN.
std::optional<Cell> find_cell(const Box3d& bounds, const Vec3i& brick_min, const Vec3d& p) {
  if (!(p.x >= bounds.min.x && p.x < bounds.max.x && p.y >= bounds.min.y && p.y < bounds.max.y &&
        p.z >= bounds.min.z && p.z < bounds.max.z))
    return std::nullopt;
  const double x = std::floor(p.x), y = std::floor(p.y), z = std::floor(p.z);
  const int cx = int(x) - brick_min.x * kCells, cy = int(y) - brick_min.y * kCells,
            cz = int(z) - brick_min.z * kCells;
  return Cell{Vec3i(cx / kCells, cy / kCells, cz / kCells),
              (cz % kCells * kNodes + cy % kCells) * kNodes + cx % kCells, float(p.x - x),
              float(p.y - y), float(p.z - z)};
}

}  // namespace

float BrickGrid::sample(const Vec3d& p_index) const {
  const auto cell = find_cell(index_bounds_, brick_min_, p_index);
  if (!cell) return 0;
  const std::int32_t entry = top(cell->brick);
  if (entry == kEmpty) return 0;
  if (entry < 0) return tile(entry);
  return trilinear<float>(brick(entry) + cell->offset, cell->fx, cell->fy, cell->fz).value;
}

BrickGrid::ValueGradient BrickGrid::sample_gradient(const Vec3d& p_index) const {
  const auto cell = find_cell(index_bounds_, brick_min_, p_index);
  if (!cell) return {};
  const std::int32_t entry = top(cell->brick);
  if (entry == kEmpty) return {};
  if (entry < 0) return {tile(entry), Vec3d(0.0)};
  const auto t = trilinear<double>(brick(entry) + cell->offset, cell->fx, cell->fy, cell->fz);
  return {t.value, Vec3d(t.dx, t.dy, t.dz)};
}

std::size_t BrickGrid::memory_bytes() const {
  return sizeof *this + top_.capacity() * sizeof(std::int32_t) +
         (bricks_->capacity() + tiles_.capacity()) * sizeof(float) +
         brick_ranges_.capacity() * sizeof(ValueRange);
}

Fingerprint BrickGrid::fingerprint() const {
  FingerprintBuilder builder;
  builder.add("brick grid");
  for (int a = 0; a < 3; ++a) builder.add(brick_min_[a]).add(brick_count_[a]);
  builder.add(top_).add(*bricks_).add(tiles_);
  for (const auto& row : index_to_world_.m) builder.add_bytes(row.data(), sizeof row);
  return builder.finish();
}

}  // namespace brume
