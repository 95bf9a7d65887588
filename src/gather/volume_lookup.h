// Volume records around a point, without those that a surface hides from it.
#pragma once

#include <span>
#include <vector>

#include "cache/volume_cache.h"
#include "scene/world.h"

namespace brume {

struct VolumePart {
  std::uint32_t record;
  float weight;
};

// World and cache must outlive it. Read from any thread.
class VolumeLookup {
 public:
  VolumeLookup(const World& world, const VolumeCache& cache);

  const VolumeCache& cache() const { return cache_; }
  // Records that cover p and see it, in record order; weights sum to 1. Where there is none, radii
  // are doubled, up to kMostDoublings times or until kMostParts records are in reach; empty where
  // still none is found.
  void find(const Vec3d& p, std::vector<VolumePart>& parts) const;
  // The same at a record, without it.
  void find_others(std::uint32_t record, std::vector<VolumePart>& parts) const;
  // Whether find() needs no doubling.
  bool covers(const Vec3d& p) const;
  // Moments at p, three channels each: the mean with find()'s weights. False where it finds
  // nothing; then all are 0.
  bool moments(const Vec3d& p, std::span<float> out) const;

 private:
  static constexpr std::uint32_t kNobody = 0xffffffff;
  void find(const Vec3d& p, std::uint32_t but, std::vector<VolumePart>& parts) const;
  void centre(std::vector<VolumePart>& parts, std::span<const Vec3d> offsets) const;
  void find_scattering();
  double density(std::uint32_t record, double min_radius) const;
  bool is_visible(const Vec3d& p, std::uint32_t record) const;

  static constexpr int kMostDoublings = 12;
  static constexpr std::size_t kMostParts = 64;
  const World& world_;
  const VolumeCache& cache_;
  double least_radius_ = 0;
  std::vector<float> scattering_;  // sigma_s at each record, beside the largest.
};

}  // namespace brume
