// Scattered light between volume records: weights, extrapolation, and the index that finds who answers
// (radiance caching in media [JDZJ08], with moments instead of a record for each direction).
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "cache/record_index.h"
#include "cache/volume_record.h"

namespace brume {

struct VolumeQuery {
  int layer = kDeepVolumeLayer;
  Vec3d position{0.0};
  double min_radius = 0;  // Records act as if their radii were at least this.
};

// sum over moments of weight * moment, between records.
struct InterpolatedScatter {
  RgbD value;
  int records = 0;       // How many answered; 0: the point is not covered.
  bool clamped = false;  // An extrapolation had to be kept at or above 0 or below twice its record's value.
};

// Frozen: built once, then queried from any thread. Records with a record_fault() are kept and never
// answer.
class VolumeCache {
 public:
  VolumeCache() : VolumeCache({}, Vec3d(0.0)) {}
  // Records in another order than VolumeRecordOrder are sorted first.
  VolumeCache(VolumeRecords records, const Vec3d& origin);

  const VolumeRecords& all() const { return all_; }
  std::size_t size() const { return all_.size(); }
  int order() const { return all_.order; }
  const Vec3d& origin() const { return origin_; }

  // Weighted mean over records whose error, the distance in their radii, is below 1; weight 1 - error.
  // `weights`: one for each moment, for example g^l Y_lm(w) / (4 pi). Never negative or non-finite.
  // Sums run in record order.
  InterpolatedScatter scatter(const VolumeQuery& query, std::span<const double> weights) const;
  // Whether some record answers with error below `max_error` (at most 1).
  bool covers(const VolumeQuery& query, double max_error = 1) const;
  // Who answers and with which weight (1 - error), in record order.
  std::vector<std::pair<std::uint32_t, double>> explain(const VolumeQuery& query) const;

 private:
  double error_at(const RecordSite& site, const Vec3d& p, double min_radius) const;
  const RecordIndex* layer(int layer) const;

  VolumeRecords all_;
  Vec3d origin_;
  std::vector<RecordIndex> layers_;
};

}  // namespace brume
