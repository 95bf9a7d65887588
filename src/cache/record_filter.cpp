#include "cache/record_filter.h"

#include <algorithm>
#include <unordered_map>

#include "cache/irradiance_cache.h"
#include "core/hash.h"

namespace brume {
namespace {

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

double record_luminance(const SurfaceRecord& record) {
  return luminance(RgbD(record.irradiance[0], record.irradiance[1], record.irradiance[2]));
}

// Records kept so far, by cells as wide as the spacing.
class Neighbourhood {
 public:
  explicit Neighbourhood(double spacing) : spacing_(spacing) {}

  bool has_close_to(const SurfaceRecord& record) const {
    const Cell c = cell_of(record);
    for (int i = 0; i < 27; ++i) {
      const auto found =
          cells_.find({c.layer, c.x + i % 3 - 1, c.y + i / 3 % 3 - 1, c.z + i / 9 - 1});
      if (found == cells_.end()) continue;
      for (const SurfaceRecord* other : found->second)
        if ((vector(other->position) - vector(record.position)).length2() < spacing_ * spacing_ &&
            vector(other->normal).dot(vector(record.normal)) > kMaxNormalCosine)
          return true;
    }
    return false;
  }
  void add(const SurfaceRecord& record) { cells_[cell_of(record)].push_back(&record); }

 private:
  struct Cell {
    int layer;
    double x, y, z;  // Whole numbers; doubles, as coordinates over a tiny spacing pass 64 bits.
    bool operator==(const Cell&) const = default;
  };
  struct Hash {
    std::size_t operator()(const Cell& c) const { return hash64(&c.x, 3 * sizeof c.x) + c.layer; }
  };
  Cell cell_of(const SurfaceRecord& record) const {
    // Adding 0 makes -0 one with 0, for the hash.
    const auto at = [&](int a) { return std::floor(record.position[a] / spacing_) + 0.0; };
    return {record.layer(), at(0), at(1), at(2)};
  }

  double spacing_;
  std::unordered_map<Cell, std::vector<const SurfaceRecord*>, Hash> cells_;
};

bool matches(const SurfaceRecord& record, const RecordFilter& filter,
             const std::vector<std::uint64_t>& sorted_keys, const Vec3d& origin) {
  return (!filter.box || filter.box->intersects(origin + vector(record.position))) &&
         (!filter.waves || filter.waves->contains(record.wave())) &&
         (!filter.radius || filter.radius->contains(record_radius(record))) &&
         (!filter.relative_error ||
          filter.relative_error->contains(record_relative_error(record))) &&
         (!filter.luminance || filter.luminance->contains(record_luminance(record))) &&
         (sorted_keys.empty() ||
          std::binary_search(sorted_keys.begin(), sorted_keys.end(), record.key));
}

}  // namespace

double record_radius(const SurfaceRecord& record) {
  return std::sqrt(double(record.radius[0]) * record.radius[1]);
}

double record_relative_error(const SurfaceRecord& record) {
  return record.error == 0 ? 0 : record.error / record_luminance(record);
}

FilteredCache filter_records(CacheContents contents, const RecordFilter& filter) {
  std::vector<std::uint64_t> keys = filter.keys;
  std::sort(keys.begin(), keys.end());
  const std::vector<SurfaceRecord>& records = contents.records;
  int top = filter.top_layer;
  if (top < 0)
    for (const SurfaceRecord& record : records) top = std::max(top, record.layer());

  std::vector<bool> keep(records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    const SurfaceRecord& record = records[i];
    if (record_fault(record)) continue;
    if (!filter.layers && record.layer() != top) {
      keep[i] = true;
      continue;
    }
    const bool is_chosen = (!filter.layers || filter.layers->contains(record.layer())) &&
                           matches(record, filter, keys, contents.header.origin);
    keep[i] = is_chosen != filter.is_inverted;
  }
  if (filter.spacing) {
    Neighbourhood kept(*filter.spacing);
    for (std::size_t i = 0; i < records.size(); ++i) {
      if (!keep[i] || (!filter.layers && records[i].layer() != top)) continue;
      if (kept.has_close_to(records[i]))
        keep[i] = false;
      else
        kept.add(records[i]);
    }
  }

  FilteredCache result;
  int lowest_gone = 256, highest_kept = -1;
  bool has_gap_on_top = filter.is_part;
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (keep[i]) {
      highest_kept = std::max(highest_kept, records[i].layer());
    } else {
      ++result.dropped;
      lowest_gone = std::min(lowest_gone, records[i].layer());
      has_gap_on_top |= records[i].layer() == top;
    }
  }
  // Records of the medium go with the deep ones, all or none.
  const bool keeps_medium = !filter.layers || filter.layers->contains(kDeepLayer);
  if (!keeps_medium && contents.volume.size() > 0) {
    result.dropped += contents.volume.size();
    lowest_gone = kDeepLayer;
  }
  result.is_part = filter.is_part || result.dropped > 0;
  if (!result.is_part) {
    result.contents = std::move(contents);
    return result;
  }
  result.contents.header = contents.header;
  if (keeps_medium) {
    result.contents.volume = std::move(contents.volume);
    result.contents.notes.solve = std::move(contents.notes.solve);
  }
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (!keep[i]) continue;
    result.contents.records.push_back(records[i]);
    if (has_gap_on_top && records[i].layer() == top)
      result.contents.records.back().flags |= kUnfinishedViewFlag;
  }
  // Bakes take a deeper layer with any records of its own, or above it, for done.
  result.lacks_deeper_layers =
      lowest_gone < highest_kept || (lowest_gone == highest_kept && highest_kept != top);
  if (result.lacks_deeper_layers)
    result.contents.header.fingerprint =
        FingerprintBuilder().add("part of a cache").add(contents.header.fingerprint).finish();
  return result;
}

}  // namespace brume
