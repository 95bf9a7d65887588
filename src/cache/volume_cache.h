// Volume records and the index that finds those that cover a place (radiance caching in media
// [JDZJ08], with moments instead of a record for each direction). Light between them:
// gather/volume_lookup.h.
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

// Frozen: built once, then queried from any thread. Records with a record_fault() are kept and
// never answer.
class VolumeCache {
 public:
  VolumeCache() : VolumeCache({}, Vec3d(0.0)) {}
  // Records in another order than VolumeRecordOrder are sorted first.
  VolumeCache(VolumeRecords records, const Vec3d& origin);

  const VolumeRecords& all() const { return all_; }
  std::size_t size() const { return all_.size(); }
  int order() const { return all_.order; }
  const Vec3d& origin() const { return origin_; }

  // The records whose error at the query, the distance in their radii, is below 1, with 1 - error,
  // in record order.
  std::vector<std::pair<std::uint32_t, double>> explain(const VolumeQuery& query) const;

 private:
  // What a query reads of a record, side by side.
  struct Kernel {
    float position[3], inverse_radius[3];
    bool is_turned = false;  // Its axes are not the world's, and matter.
  };
  // Of the error; inverse radii count as at most `most_inverse`.
  double squared_error_at(std::uint32_t record, const Vec3d& p, double most_inverse) const;

  VolumeRecords all_;
  Vec3d origin_;
  std::vector<Kernel> kernels_;
  // By layer, then by octave of the widest radius: supports in one tree are about as large.
  std::vector<std::vector<RecordIndex>> layers_;
};

}  // namespace brume
