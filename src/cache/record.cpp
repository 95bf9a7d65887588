#include "cache/record.h"

#include <cstring>
#include <limits>

namespace brume {

const char* record_fault(const SurfaceRecord& record) {
  constexpr std::size_t kFloats = offsetof(SurfaceRecord, flags) / sizeof(float);
  static_assert(kFloats * sizeof(float) == offsetof(SurfaceRecord, flags));
  std::uint32_t words[kFloats];
  std::memcpy(words, &record, sizeof words);
  std::uint32_t bad = 0;  // Without a branch a word: a million records are checked while loading.
  for (const std::uint32_t word : words) bad |= (word & 0x7f800000u) == 0x7f800000u;
  if (bad != 0) return "a value is not finite";

  const float* n = record.normal;
  const float length2 = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
  if (!(std::abs(length2 - 1) < 1e-3f)) return "the normal is not of unit length";
  for (const float e : record.irradiance)
    if (!(e >= 0)) return "the irradiance is negative";
  for (const float r : record.radius)
    if (!(r >= std::numeric_limits<float>::min())) return "a radius is not positive";
  if (!(record.error >= 0)) return "the error is negative";
  // A quotient of two rounded sums may pass 1 by a few ulp.
  if (!(record.media_share >= 0 && record.media_share <= 1.0001f))
    return "the media share is outside [0, 1]";
  return nullptr;
}

}  // namespace brume
