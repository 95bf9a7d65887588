// Light at one point of the medium that has scattered already, in the medium or off surfaces, with
// what is needed to use it nearby. The struct and the moments behind it are the layout on disk
// (docs/cache_format.md): little-endian, no padding.
#pragma once

#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "core/math.h"
#include "core/spherical_harmonics.h"

namespace brume {

// What all volume records begin with.
struct VolumeRecord {
  float position[3];    // Relative to the cache's origin, world units.
  float radius[3];      // Along the axes; world units. Split-sphere records have one radius.
  float axes[4];        // Quaternion (w, x, y, z) that turns x, y, z into the axes of the radii; unit.
  float error;          // Estimated standard error of the fluence's luminance [W/m^2].
  float media_share;    // Part of the fluence's luminance that came from the medium, in [0,1].
  std::uint32_t flags;  // As of surface records; the layer is kDeepVolumeLayer.
  float clearance;      // To the nearest surface that its gather met; the largest float for none.
  std::uint64_t key;    // What the record is a pure function of, with the fingerprint.

  int layer() const { return static_cast<int>(flags & 0xff); }
  int wave() const { return static_cast<int>((flags >> 8) & 0xff); }
};
static_assert(sizeof(VolumeRecord) == 64 && std::is_trivially_copyable_v<VolumeRecord>);

// One set for all orders of scattering, which gathers and eyes ask alike.
inline constexpr int kDeepVolumeLayer = 0;

// One moment, int L(w) Y(w) dw over the sphere (core/spherical_harmonics.h). L is all incident radiance
// but that which comes straight from lights. The first is the fluence [W/m^2]. There are no gradients:
// the weights between records nearly reproduce what is linear (gather/volume_lookup.h).
struct VolumeMoment {
  float value[3];
};
static_assert(sizeof(VolumeMoment) == 12);

// Bytes of a record with moments up to `order`.
inline constexpr std::size_t volume_record_bytes(int order) {
  return sizeof(VolumeRecord) + harmonic_count(order) * sizeof(VolumeMoment);
}

// Records of one cache, all of the same order: record i has moments [i * count, (i + 1) * count).
struct VolumeRecords {
  int order = 0;
  std::vector<VolumeRecord> records;
  std::vector<VolumeMoment> moments;

  std::size_t size() const { return records.size(); }
  std::size_t stride() const { return harmonic_count(order); }
  std::span<VolumeMoment> moments_of(std::size_t i) { return {&moments[i * stride()], stride()}; }
  std::span<const VolumeMoment> moments_of(std::size_t i) const {
    return {&moments[i * stride()], stride()};
  }
  void push_back(const VolumeRecord& record, std::span<const VolumeMoment> its);
  // Into VolumeRecordOrder, one of each key in a layer.
  void sort();
  // In every bit.
  friend bool operator==(const VolumeRecords& a, const VolumeRecords& b);
};

// What is wrong with a record's values, or null: finite, fluence not negative, positive radii, unit
// axes. The file refuses such records in both directions and no index answers with one.
const char* record_fault(const VolumeRecord& record, std::span<const VolumeMoment> moments);

struct VolumeRecordOrder {
  bool operator()(const VolumeRecord& a, const VolumeRecord& b) const {
    if (a.layer() != b.layer()) return a.layer() < b.layer();
    if (a.wave() != b.wave()) return a.wave() < b.wave();
    return a.key < b.key;
  }
};

}  // namespace brume
