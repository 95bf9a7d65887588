// Irradiance between records: weights, extrapolation with both gradients, and the index that finds
// who answers [WRC88, WH92].
//
// Layers are separate: layer B answers eye rays, layer l < B answers the hits of gathers for layer
// l + 1 (SPEC, bounces). A query names its layer.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "cache/record.h"
#include "cache/record_index.h"
#include "cache/volume_cache.h"
#include "core/math.h"
#include "geom/ray_tracer.h"

namespace brume {

// The largest angle between normals that a record bridges (cosine).
inline constexpr double kMaxNormalCosine = 0.8;
// How far behind a record's surface, in parts of its smaller radius, a query may lie (rounding,
// bumps).
inline constexpr double kBehindTolerance = 0.05;

// One record's part in an answer.
struct RecordWeight {
  const SurfaceRecord* record = nullptr;
  double weight = 0;
  RgbD extrapolated;  // Its irradiance carried to the query, before clamping.
};

struct InterpolatedIrradiance {
  RgbD irradiance;  // Never negative, never non-finite; 0 when nobody answers.
  int records = 0;  // How many answered; 0: the point is not covered.
  bool clamped =
      false;  // An extrapolation had to be kept at or above 0 or below twice its record's value.
  double media_share = 0;
  int stretches = 0;  // Doublings that it took.
};

struct IrradianceQuery {
  int layer = 0;
  Vec3d position{0.0};
  Vec3d normal{0.0};      // Unit, on the side that receives.
  double min_radius = 0;  // Records act as if their radii were at least this (a pixel's footprint).
  // What hides records from the query: they never answer through a surface. Costs a ray for each
  // record that does not know by itself that its surroundings are clear (kClearFlag): 0.1
  // microseconds a query in a cluttered room. Null: nothing.
  const RayTracer* surfaces = nullptr;
  // Where nobody answers, min_radius is doubled up to so many times. Not by covers().
  int stretches = 0;
  // Whoever reaches the query by itself answers alone; min_radius counts where nobody does. Not for
  // covers(). Cheaper, and not smooth where coverage ends.
  bool only_if_open = false;
};

// Frozen: built once from records in RecordOrder (others are sorted first), then queried from any
// thread. Records with a record_fault() are kept and never answer.
class IrradianceCache {
 public:
  IrradianceCache() : IrradianceCache({}, Vec3d(0.0)) {}
  // `curve_order`: what curve_order() gave for these very records, layer after layer; saves time.
  // `volume`: the records of the medium, of the same origin; null for none.
  IrradianceCache(std::vector<SurfaceRecord> records, const Vec3d& origin,
                  std::span<const std::uint32_t> curve_order = {},
                  std::shared_ptr<const VolumeCache> volume = nullptr);

  std::span<const SurfaceRecord> records() const { return records_; }
  // Records of both kinds.
  std::size_t size() const { return records_.size() + volume_->size(); }
  // Of the medium. Never null.
  const std::shared_ptr<const VolumeCache>& volume() const { return volume_; }
  const Vec3d& origin() const { return origin_; }
  int layers() const { return static_cast<int>(layers_.size()); }
  // The records of a layer that may answer, as lookups sort them.
  std::vector<std::uint32_t> curve_order(int layer) const;

  // Weighted mean over records whose error at the query is below 1:
  //   e = max(sqrt((d.e1/R1)^2 + (d.e2/R2)^2 + (d.n/Rmin)^2), sqrt((1 - n.n') / (1 - cos_max))),
  // weight 1 - e, skipping records that look at the query from behind or that a surface hides from
  // it. Sums run in record order.
  InterpolatedIrradiance irradiance(const IrradianceQuery& query) const;
  // Whether some record answers with error below `max_error` (at most 1); stops at the first.
  bool covers(const IrradianceQuery& query, double max_error = 1) const;
  // Who answers, in record order (inspect --at).
  std::vector<RecordWeight> explain(const IrradianceQuery& query) const;

 private:
  const RecordIndex* layer(int layer) const;  // Null for a layer without records.

  std::vector<SurfaceRecord> records_;
  Vec3d origin_;
  std::vector<RecordIndex> layers_;
  std::shared_ptr<const VolumeCache> volume_;
};

}  // namespace brume
