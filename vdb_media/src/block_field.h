// A voxel field as 8x8x8 blocks and constant tiles: what is left of an OpenVDB tree once its value
// type is gone, and what bricks are made of.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "grid_blob.h"

namespace brume {

struct IndexBox {
  Vec3i min{0}, max{-1};  // Inclusive.
  bool is_empty() const { return max.x < min.x || max.y < min.y || max.z < min.z; }
  bool contains(const Vec3i& p) const {
    return p.x >= min.x && p.x <= max.x && p.y >= min.y && p.y <= max.y && p.z >= min.z &&
           p.z <= max.z;
  }
};

class BlockField {
 public:
  static constexpr int kBlockVoxels = 512;

  // A cube of `blocks` blocks a side, its lowest block at `block` (in blocks).
  struct Tile {
    Vec3i block{0};
    int blocks = 1;
    std::array<float, 3> value{};
  };
  // What fills `box` wherever no block or tile says otherwise; nothing reaches outside it.
  struct Fill {
    IndexBox box;
    std::array<float, 3> value{};
  };

  explicit BlockField(int channels) : channels_(channels) {}

  int channels() const { return channels_; }
  // Adds a block, zero for now, and returns its channels, one after the other, voxels x fastest.
  // Valid until the next call.
  float* add_block(const Vec3i& block);
  void add_tile(const Tile& tile) { tiles_.push_back(tile); }
  void set_fill(const Fill& fill) { fill_ = fill; }
  void reserve_blocks(std::size_t count);

  // Replaces what no marcher can use: NaN, infinite or above kAbsurd, negative. Denormals become 0
  // without being counted. Throws Error(InvalidInput) under BadVoxelPolicy::Error.
  BadVoxels sanitize(BadVoxelPolicy policy, const std::string& place,
                     std::vector<std::string>* warnings);

  // One BrickArrays a channel. Throws Error(InvalidInput), starting with `place`, where the extent
  // is too large to index.
  std::vector<BrickArrays> build_bricks(const Affine3d& index_to_world,
                                        const std::string& place) const;

  static constexpr float kAbsurd = 1e30f;

 private:
  friend class BlockIndex;

  int channels_;
  std::vector<Vec3i> block_positions_;
  std::vector<float> block_values_;  // channels_ * kBlockVoxels a block.
  std::vector<Tile> tiles_;
  std::optional<Fill> fill_;
};

// Finds the block or tile at any block position in constant time. Holds 4 bytes a position of the
// extent.
class BlockIndex {
 public:
  // Throws Error(InvalidInput), starting with `place`, where the extent is too large.
  BlockIndex(const BlockField& field, const std::string& place);

  bool is_empty() const { return entries_.empty(); }
  const IndexBox& extent() const { return extent_; }  // In blocks.

  // kNothing, a block's number >= 0, or -2-k for the constant k. Any position may be asked for.
  std::int32_t at(const Vec3i& block) const;
  static constexpr std::int32_t kNothing = -1;

  const float* block(std::int32_t entry, int channel) const;
  float constant(std::int32_t entry, int channel) const {
    return constants_[std::size_t(-2 - entry)][std::size_t(channel)];
  }
  // The voxel's value, 0 outside.
  float value(const Vec3i& voxel, int channel) const;

 private:
  std::size_t slot(const Vec3i& block) const;
  void place_blocks();
  void place_constant(const IndexBox& blocks, const std::array<float, 3>& value);
  void clip_block(const Vec3i& block, const IndexBox& box);

  const BlockField& field_;
  IndexBox extent_;
  std::vector<std::int32_t> entries_;
  std::vector<std::array<float, 3>> constants_;
  std::vector<float>
      clipped_blocks_;  // Those that the edge of a fill cuts; numbered after the field's.
};

}  // namespace brume
