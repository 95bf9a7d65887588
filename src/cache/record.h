// Irradiance at one point of a surface, with what is needed to use it nearby. The struct is the layout on
// disk (docs/cache_format.md): little-endian, 128 bytes, no padding.
#pragma once

#include <cstdint>
#include <type_traits>

#include "core/math.h"

namespace brume {

struct SurfaceRecord {
  float position[3];    // Relative to the cache's origin, world units.
  float normal[3];      // Unit.
  float irradiance[3];  // [W/m^2]
  float gradient[9];    // dE/d(x,y,z), three numbers a channel, all components [W/m^2 per world unit].
  float rotational[6];  // Rotational gradient, (u, v) of Frame(normal) for each channel.
  float axis;           // Angle of the first radius' axis from u in Frame(normal) [rad].
  float radius[2];      // Along the axis and across it; world units.
  float error;          // Estimated standard error of the irradiance's luminance [W/m^2].
  float media_share;    // Part of the luminance that came from the medium, in [0,1].
  std::uint32_t flags;  // Bits 0-7: layer, 8-15: wave, 16: radius clamped by a neighbour, 17 and 18: below.
  std::uint64_t key;    // What the record is a pure function of, with the fingerprint.

  int layer() const { return static_cast<int>(flags & 0xff); }
  int wave() const { return static_cast<int>((flags >> 8) & 0xff); }
};
static_assert(sizeof(SurfaceRecord) == 128 && std::is_trivially_copyable_v<SurfaceRecord>);

// Deep records hold what gathers see at their hits, solved for all bounces; top records, what eyes see.
enum SurfaceLayer : int { kDeepLayer = 0, kTopLayer = 1 };

inline constexpr std::uint32_t kRadiusClampedFlag = 1u << 16;
// From a view that was stopped before its last tile: answers like any other, but a bake that resumes
// decides again whether it is needed, as if it had not been stopped.
inline constexpr std::uint32_t kUnfinishedViewFlag = 1u << 17;
// Nothing rises above the record's plane within its radius: whoever lies there on the same side is
// seen by it, without a ray.
inline constexpr std::uint32_t kClearFlag = 1u << 18;
inline std::uint32_t record_flags(int layer, int wave) {
  return static_cast<std::uint32_t>(layer & 0xff) | static_cast<std::uint32_t>(wave & 0xff) << 8;
}

// What is wrong with a record's values (in a few words), or null: finite, unit normal, nothing negative,
// positive radii. The file refuses such records in both directions and no index answers with one.
const char* record_fault(const SurfaceRecord& record);

// A record's place in the one order that every file and every sum uses: layer, wave, key.
struct RecordOrder {
  bool operator()(const SurfaceRecord& a, const SurfaceRecord& b) const {
    if ((a.flags & 0xffff) != (b.flags & 0xffff)) {
      if (a.layer() != b.layer()) return a.layer() < b.layer();
      return a.wave() < b.wave();
    }
    return a.key < b.key;
  }
};

}  // namespace brume
