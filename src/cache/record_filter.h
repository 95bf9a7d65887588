// Some of a cache's records: chosen by place, layer, wave, size, error or key, and thinned.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "cache/cache_file.h"
#include "core/math.h"

namespace brume {

struct IntegerRange {
  int first = 0, last = 255;  // Both included.
  bool contains(int value) const { return value >= first && value <= last; }
};
struct NumberRange {
  double least = 0, most = kInfinity;  // Both included.
  bool contains(double value) const { return value >= least && value <= most; }
};

// A record is kept where everything that is given holds.
struct RecordFilter {
  int top_layer = -1;        // The one that eye rays ask; -1: the highest there is.
  std::optional<Box3d> box;  // World space, faces included.
  // Nothing: the criteria choose among the top layer and deeper layers stay whole, as a bake that
  // goes on reads them. Given: they choose among these layers, and records of others go.
  std::optional<IntegerRange> layers;
  std::optional<IntegerRange> waves;
  std::optional<NumberRange> radius;          // sqrt(r1 r2), world units.
  std::optional<NumberRange> relative_error;  // Standard error over luminance.
  std::optional<NumberRange> luminance;       // Of irradiance [W/m^2].
  std::vector<std::uint64_t> keys;            // Empty: all.
  bool is_part = false;                       // What comes in may lack records already.
  bool is_inverted = false;                   // Keeps what the criteria above would drop.
  // Then, of what is left: a record goes where one kept before it, on the same side and in its
  // layer, is closer than this (world units). Coarse waves come first, so they stay.
  std::optional<double> spacing;
};

struct FilteredCache {
  CacheContents contents;
  std::size_t dropped = 0;
  bool is_part = false;  // Says so itself; see filter_records().
  // Something of a layer is gone that layers above it gathered from: no bake may go on from this.
  bool lacks_deeper_layers = false;
};

// Mean radius, and error over luminance (0 for no error, infinite for an error of darkness).
double record_radius(const SurfaceRecord& record);
double record_relative_error(const SurfaceRecord& record);

// Records with a record_fault() always go. What is left of a cache says so itself, so that nothing
// takes it for whole (docs/cache_format.md, "Parts of a cache"):
// - of the top layer, records carry kUnfinishedViewFlag: they answer, and a bake that goes on
// decides anew
//   what is missing;
// - without all the deeper records that others were gathered from, the fingerprint is another, made
// of the
//   first: it is stale for every scene, and good for looking at.
// Where nothing goes and nothing went before, the contents are those that came.
FilteredCache filter_records(CacheContents contents, const RecordFilter& filter);

}  // namespace brume
