// A piece of flat ground as points to gather at.
#pragma once

#include <optional>
#include <vector>

#include "study/ground_study.h"

namespace brume {

class GroundPlane {
 public:
  GroundPlane(const StudyScene& scene, const Box3d& area) : scene_(scene), area_(area) {}

  // Keyed by `key`; nothing where no ground faces up, or inside of something that stands on it.
  std::optional<GatherPoint> at(double x, double z, std::uint64_t key) const;
  double x(double part) const { return area_.min.x + part * area_.size().x; }
  double z(double part) const { return area_.min.z + part * area_.size().z; }

 private:
  const StudyScene& scene_;
  Box3d area_;
};

// Records on a grid of `along` by `along`, one a cell of the area and near its middle, as `key`
// says; with a radius at which they cover it without gaps.
struct GroundRecords {
  std::vector<GatherPoint> points;
  double radius = 0;
};
GroundRecords ground_records(const GroundPlane& ground, const Box3d& area, int along,
                             std::uint64_t key);

// A cache a mode, from one gather a record.
std::array<IrradianceCache, kModeCount> make_ground_caches(const GroundRecords& records,
                                                           const std::vector<PointGather>& gathers);

}  // namespace brume
