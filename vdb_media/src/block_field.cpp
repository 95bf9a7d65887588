#include "block_field.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace brume {
namespace {

constexpr int kEdge = BrickGrid::kCells;
constexpr int kNodes = BrickGrid::kNodes;
// Voxel indices stay within +-2^30, a brick short of it so that neighbours fit too (HARD_CASES
// N13).
constexpr std::int64_t kMaxBlock = (std::int64_t(1) << 30) / kEdge - 2;

Vec3i block_of(const Vec3i& voxel) { return {voxel.x >> 3, voxel.y >> 3, voxel.z >> 3}; }
int offset_in_block(const Vec3i& voxel) {
  return ((voxel.z & 7) * kEdge + (voxel.y & 7)) * kEdge + (voxel.x & 7);
}

template <typename F>
void for_each(const IndexBox& box, F f) {
  for (int z = box.min.z; z <= box.max.z; ++z)
    for (int y = box.min.y; y <= box.max.y; ++y)
      for (int x = box.min.x; x <= box.max.x; ++x) f(Vec3i(x, y, z));
}

IndexBox intersection(const IndexBox& a, const IndexBox& b) {
  IndexBox r;
  for (int i = 0; i < 3; ++i) {
    r.min[i] = std::max(a.min[i], b.min[i]);
    r.max[i] = std::min(a.max[i], b.max[i]);
  }
  return r;
}

IndexBox voxels_of(const Vec3i& block) { return {block * kEdge, block * kEdge + Vec3i(kEdge - 1)}; }

enum class Fault { None, Denormal, Nan, Infinite, Negative };

Fault fault_of(float v) {
  if ((v >= std::numeric_limits<float>::min() && v <= BlockField::kAbsurd) || v == 0)
    return Fault::None;
  if (std::isnan(v)) return Fault::Nan;
  if (std::abs(v) > BlockField::kAbsurd) return Fault::Infinite;
  return v <= -std::numeric_limits<float>::min() ? Fault::Negative : Fault::Denormal;
}

std::string text(const Vec3i& v) {
  return "(" + std::to_string(v.x) + ", " + std::to_string(v.y) + ", " + std::to_string(v.z) + ")";
}

// Counts a voxel once, by the worst of its channels.
class FaultCounter {
 public:
  template <typename Position>
  void add(Fault fault, std::uint64_t voxels, Position position) {
    if (fault == Fault::None || fault == Fault::Denormal) return;
    if (counts.total() == 0) first = position();
    (fault == Fault::Nan        ? counts.nan
     : fault == Fault::Infinite ? counts.infinite
                                : counts.negative) += voxels;
  }
  std::string describe() const {
    std::string kinds;
    const auto kind = [&](std::uint64_t n, const char* name) {
      if (n > 0) kinds += (kinds.empty() ? "" : ", ") + std::to_string(n) + " " + name;
    };
    kind(counts.nan, "NaN");
    kind(counts.infinite, "infinite or beyond 1e30");
    kind(counts.negative, "negative");
    return std::to_string(counts.total()) + " bad voxels (" + kinds + "), the first at index " +
           text(first);
  }

  BadVoxels counts;
  Vec3i first{0};
};

Fault worst(Fault a, Fault b) {
  if (a == Fault::Nan || b == Fault::Nan) return Fault::Nan;
  if (a == Fault::Infinite || b == Fault::Infinite) return Fault::Infinite;
  return std::max(a, b);
}

}  // namespace

float* BlockField::add_block(const Vec3i& block) {
  block_positions_.push_back(block);
  block_values_.resize(block_values_.size() + std::size_t(channels_) * kBlockVoxels);
  return block_values_.data() + block_values_.size() - std::size_t(channels_) * kBlockVoxels;
}

void BlockField::reserve_blocks(std::size_t count) {
  block_positions_.reserve(count);
  block_values_.reserve(count * std::size_t(channels_) * kBlockVoxels);
}

BadVoxels BlockField::sanitize(BadVoxelPolicy policy, const std::string& place,
                               std::vector<std::string>* warnings) {
  FaultCounter faults;
  float largest_good = 0;
  const auto look = [&](float v) {
    const Fault fault = fault_of(v);
    if (fault == Fault::None) largest_good = std::max(largest_good, v);
    return fault;
  };
  const auto look_at_channels = [&](const std::array<float, 3>& value) {
    Fault fault = Fault::None;
    for (int c = 0; c < channels_; ++c) fault = worst(fault, look(value[std::size_t(c)]));
    return fault;
  };

  std::array<Fault, kBlockVoxels> found;
  bool any_denormal = false;
  for (std::size_t b = 0; b < block_positions_.size(); ++b) {
    found.fill(Fault::None);
    bool any = false;
    const float* v = block_values_.data() + b * std::size_t(channels_) * kBlockVoxels;
    for (int c = 0; c < channels_; ++c)
      for (std::size_t i = 0; i < kBlockVoxels; ++i, ++v) {
        const Fault fault = look(*v);
        if (fault == Fault::None) continue;
        any = true;
        found[i] = worst(found[i], fault);
      }
    any_denormal |= any;
    for (int i = 0; any && i < kBlockVoxels; ++i)
      faults.add(found[std::size_t(i)], 1, [&] {
        return block_positions_[b] * kEdge + Vec3i(i % kEdge, i / kEdge % kEdge, i / kEdge / kEdge);
      });
  }
  for (const Tile& tile : tiles_) {
    const std::uint64_t edge = std::uint64_t(tile.blocks) * kEdge;
    faults.add(look_at_channels(tile.value), edge * edge * edge,
               [&] { return tile.block * kEdge; });
  }
  if (fill_) faults.add(look_at_channels(fill_->value), 1, [&] { return fill_->box.min; });

  const bool bad = faults.counts.total() > 0;
  if (bad && policy == BadVoxelPolicy::Error)
    throw Error(ErrorKind::InvalidInput,
                place + ": " + faults.describe() +
                    ": repair the file, or use --on-bad-voxels zero or clamp");
  if (bad || any_denormal) {
    const float replacement = policy == BadVoxelPolicy::Clamp ? largest_good : 0;
    const auto mend = [&](float& v) {
      const Fault fault = fault_of(v);
      if (fault != Fault::None) v = fault == Fault::Infinite && v > 0 ? replacement : 0;
    };
    for (float& v : block_values_) mend(v);
    for (Tile& tile : tiles_)
      for (float& v : tile.value) mend(v);
    if (fill_)
      for (float& v : fill_->value) mend(v);
  }
  if (bad)
    warnings->push_back(
        place + ": " + faults.describe() +
        (policy == BadVoxelPolicy::Clamp ? ": clamped to what is valid" : ": set to 0"));
  return faults.counts;
}

BlockIndex::BlockIndex(const BlockField& field, const std::string& place) : field_(field) {
  // 64 bits, so that positions near the ends of int cannot wrap.
  std::array<std::int64_t, 3> lo, hi;
  lo.fill(std::numeric_limits<std::int64_t>::max());
  hi.fill(std::numeric_limits<std::int64_t>::min());
  const auto include = [&](const Vec3i& first, std::int64_t blocks) {
    for (int a = 0; a < 3; ++a) {
      lo[std::size_t(a)] = std::min<std::int64_t>(lo[std::size_t(a)], first[a]);
      hi[std::size_t(a)] = std::max<std::int64_t>(hi[std::size_t(a)], first[a] + blocks - 1);
    }
  };
  const auto is_zero = [&](const std::array<float, 3>& value) {
    return std::all_of(value.begin(), value.begin() + field.channels_,
                       [](float v) { return v == 0; });
  };
  for (std::size_t b = 0; b < field.block_positions_.size(); ++b) {
    const float* v =
        field.block_values_.data() + b * std::size_t(field.channels_) * BlockField::kBlockVoxels;
    if (std::any_of(v, v + field.channels_ * BlockField::kBlockVoxels,
                    [](float f) { return f != 0; }))
      include(field.block_positions_[b], 1);
  }
  for (const auto& tile : field.tiles_)
    if (!is_zero(tile.value)) include(tile.block, tile.blocks);
  const bool fills = field.fill_ && !field.fill_->box.is_empty();
  if (fills && !is_zero(field.fill_->value)) {
    include(block_of(field.fill_->box.min), 1);
    include(block_of(field.fill_->box.max), 1);
  }
  if (lo[0] > hi[0]) return;  // Zero everywhere.

  std::int64_t positions = 1;
  for (std::size_t a = 0; a < 3; ++a) {
    if (lo[a] < -kMaxBlock || hi[a] > kMaxBlock)
      throw Error(ErrorKind::InvalidInput,
                  place +
                      ": voxel indices reach beyond +-2^30: move the grid to the origin of "
                      "its index space");
    // One more for the layer of bricks below.
    positions *= hi[a] - lo[a] + 2;
    if (positions > kMaxTopEntries)
      throw Error(ErrorKind::InvalidInput,
                  place +
                      ": extent too large: its bounding box has more than 2^27 blocks of 8x8x8 "
                      "voxels: crop or resample the grid, or split it into several files");
  }
  extent_ = {Vec3i(int(lo[0]), int(lo[1]), int(lo[2])), Vec3i(int(hi[0]), int(hi[1]), int(hi[2]))};
  const Vec3i size = extent_.max - extent_.min + Vec3i(1);
  entries_.assign(std::size_t(size.x) * size.y * size.z, kNothing);

  if (fills) {
    IndexBox blocks{block_of(field.fill_->box.min), block_of(field.fill_->box.max)};
    place_constant(blocks, field.fill_->value);
  }
  for (const auto& tile : field.tiles_)
    place_constant({tile.block, tile.block + Vec3i(tile.blocks - 1)}, tile.value);
  place_blocks();
  if (fills) {
    for_each(extent_, [&](const Vec3i& block) {
      const IndexBox inside = intersection(voxels_of(block), field.fill_->box);
      if (at(block) == kNothing) return;
      if (inside.is_empty()) {
        entries_[slot(block)] = kNothing;
        return;
      }
      if (inside.min != block * kEdge || inside.max != block * kEdge + Vec3i(kEdge - 1))
        clip_block(block, inside);
    });
  }
}

std::size_t BlockIndex::slot(const Vec3i& block) const {
  const Vec3i size = extent_.max - extent_.min + Vec3i(1), p = block - extent_.min;
  return (std::size_t(p.z) * size.y + p.y) * size.x + p.x;
}

void BlockIndex::place_blocks() {
  for (std::size_t b = 0; b < field_.block_positions_.size(); ++b)
    if (extent_.contains(field_.block_positions_[b]))
      entries_[slot(field_.block_positions_[b])] = std::int32_t(b);
}

void BlockIndex::place_constant(const IndexBox& blocks, const std::array<float, 3>& value) {
  // Files repeat few values in many tiles, usually in a row.
  std::int32_t entry = kNothing;
  if (std::any_of(value.begin(), value.begin() + field_.channels_,
                  [](float v) { return v != 0; })) {
    if (constants_.empty() || constants_.back() != value) constants_.push_back(value);
    entry = -1 - std::int32_t(constants_.size());
  }
  const IndexBox box = intersection(blocks, extent_);
  for (int z = box.min.z; z <= box.max.z; ++z)
    for (int y = box.min.y; y <= box.max.y; ++y) {
      if (box.max.x < box.min.x) continue;
      const auto row = entries_.begin() + std::ptrdiff_t(slot({box.min.x, y, z}));
      std::fill(row, row + (box.max.x - box.min.x + 1), entry);
    }
}

void BlockIndex::clip_block(const Vec3i& block, const IndexBox& box) {
  const std::size_t number =
      field_.block_positions_.size() +
      clipped_blocks_.size() / (std::size_t(field_.channels_) * BlockField::kBlockVoxels);
  std::vector<float> values(std::size_t(field_.channels_) * BlockField::kBlockVoxels);
  for (int c = 0; c < field_.channels_; ++c)
    for_each(box, [&](const Vec3i& voxel) {
      values[std::size_t(c * BlockField::kBlockVoxels + offset_in_block(voxel))] = value(voxel, c);
    });
  clipped_blocks_.insert(clipped_blocks_.end(), values.begin(), values.end());
  entries_[slot(block)] = std::int32_t(number);
}

std::int32_t BlockIndex::at(const Vec3i& block) const {
  return extent_.contains(block) ? entries_[slot(block)] : kNothing;
}

const float* BlockIndex::block(std::int32_t entry, int channel) const {
  const std::size_t own = field_.block_positions_.size(), number = std::size_t(entry);
  const float* base = number < own ? field_.block_values_.data() : clipped_blocks_.data();
  const std::size_t at = number < own ? number : number - own;
  return base +
         (at * std::size_t(field_.channels_) + std::size_t(channel)) * BlockField::kBlockVoxels;
}

float BlockIndex::value(const Vec3i& voxel, int channel) const {
  const std::int32_t entry = at(block_of(voxel));
  if (entry == kNothing) return 0;
  return entry < 0 ? constant(entry, channel) : block(entry, channel)[offset_in_block(voxel)];
}

namespace {

// Makes the bricks of one channel. A brick's nodes are those of its own block and the first ones of
// the seven above, so bricks reach one block below the extent.
class BrickBuilder {
 public:
  BrickBuilder(const BlockIndex& index, int channel) : index_(index), channel_(channel) {}

  BrickArrays build(const Affine3d& index_to_world) {
    BrickArrays a;
    a.index_to_world = index_to_world;
    if (index_.is_empty()) return a;
    a.brick_min = index_.extent().min - Vec3i(1);
    a.brick_count = index_.extent().max - a.brick_min + Vec3i(1);
    const IndexBox all{a.brick_min, index_.extent().max};
    a.top.reserve(std::size_t(a.brick_count.x) * a.brick_count.y * a.brick_count.z);

    std::size_t upper_bound = 0;
    for_each(all, [&](const Vec3i& b) { upper_bound += !is_uniform(around(b)); });
    a.bricks.reserve(upper_bound * BrickGrid::kBrickFloats);
    bool any = false;
    for_each(all, [&](const Vec3i& b) {
      a.top.push_back(entry(around(b), a));
      any |= a.top.back() != BrickGrid::kEmpty;
    });
    if (!any) {
      a = BrickArrays{};
      a.index_to_world = index_to_world;
    }
    return a;
  }

 private:
  // Entries of the block at a brick's place and of its upper neighbours, x first.
  using Around = std::array<std::int32_t, 8>;

  Around around(const Vec3i& b) const {
    Around e;
    for (int i = 0; i < 8; ++i) e[std::size_t(i)] = index_.at(b + Vec3i(i & 1, i >> 1 & 1, i >> 2));
    return e;
  }
  float uniform_value(std::int32_t entry) const {
    return entry == BlockIndex::kNothing ? 0 : index_.constant(entry, channel_);
  }
  bool is_uniform(const Around& e) const {
    if (e[0] >= 0) return false;
    const float value = uniform_value(e[0]);
    for (std::size_t i = 1; i < 8; ++i)
      if (e[i] != e[0] && (e[i] >= 0 || uniform_value(e[i]) != value)) return false;
    return true;
  }

  std::int32_t tile_entry(float value, BrickArrays& a) const {
    if (value == 0) return BrickGrid::kEmpty;
    if (a.tiles.empty() || a.tiles.back() != value) a.tiles.push_back(value);
    return -1 - std::int32_t(a.tiles.size());
  }

  std::int32_t entry(const Around& e, BrickArrays& a) const {
    if (is_uniform(e)) return tile_entry(uniform_value(e[0]), a);
    std::array<float, BrickGrid::kBrickFloats> nodes;
    float* to = nodes.data();
    for (int z = 0; z < kNodes; ++z)
      for (int y = 0; y < kNodes; ++y) {
        const std::size_t row = std::size_t(z >> 3) * 4 + std::size_t(y >> 3) * 2;
        const int offset = ((z & 7) * kEdge + (y & 7)) * kEdge;
        if (e[row] >= 0) {
          to = std::copy_n(index_.block(e[row], channel_) + offset, kEdge, to);
        } else {
          to = std::fill_n(to, kEdge, uniform_value(e[row]));
        }
        *to++ = e[row + 1] >= 0 ? index_.block(e[row + 1], channel_)[offset]
                                : uniform_value(e[row + 1]);
      }
    if (std::all_of(nodes.begin(), nodes.end(), [&](float v) { return v == nodes[0]; }))
      return tile_entry(nodes[0], a);
    a.bricks.insert(a.bricks.end(), nodes.begin(), nodes.end());
    return std::int32_t(a.bricks.size() / BrickGrid::kBrickFloats) - 1;
  }

  const BlockIndex& index_;
  const int channel_;
};

}  // namespace

std::vector<BrickArrays> BlockField::build_bricks(const Affine3d& index_to_world,
                                                  const std::string& place) const {
  const BlockIndex index(*this, place);
  std::vector<BrickArrays> channels;
  for (int c = 0; c < channels_; ++c)
    channels.push_back(BrickBuilder(index, c).build(index_to_world));
  return channels;
}

}  // namespace brume
