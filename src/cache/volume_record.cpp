#include "cache/volume_record.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <numeric>

namespace brume {

void VolumeRecords::push_back(const VolumeRecord& record, std::span<const VolumeMoment> its) {
  records.push_back(record);
  moments.insert(moments.end(), its.begin(), its.end());
}

void VolumeRecords::sort() {
  std::vector<std::uint32_t> to(size());
  std::iota(to.begin(), to.end(), 0u);
  std::stable_sort(to.begin(), to.end(), [&](std::uint32_t a, std::uint32_t b) {
    return VolumeRecordOrder()(records[a], records[b]);
  });
  to.erase(std::unique(to.begin(), to.end(),
                       [&](std::uint32_t a, std::uint32_t b) {
                         return records[a].key == records[b].key &&
                                records[a].layer() == records[b].layer();
                       }),
           to.end());
  VolumeRecords sorted;
  sorted.order = order;
  sorted.records.reserve(to.size());
  sorted.moments.reserve(to.size() * stride());
  for (const std::uint32_t i : to) sorted.push_back(records[i], moments_of(i));
  *this = std::move(sorted);
}

bool operator==(const VolumeRecords& a, const VolumeRecords& b) {
  const auto is_same = [](const auto& x, const auto& y) {
    return x.size() == y.size() &&
           (x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof(x[0])) == 0);
  };
  return a.order == b.order && is_same(a.records, b.records) && is_same(a.moments, b.moments);
}

const char* record_fault(const VolumeRecord& r, std::span<const VolumeMoment> moments) {
  double sum = double(r.error) + double(r.media_share) + double(r.clearance), turn2 = 0;
  for (const float p : r.position) sum += p;
  for (const float radius : r.radius) sum += radius;
  for (const float q : r.axes) turn2 += double(q) * q;
  // A sum of finite floats is a finite double.
  for (const VolumeMoment& m : moments)
    for (const float v : m.value) sum += v;
  if (!std::isfinite(sum + turn2)) return "a value is not finite";
  if (!(std::abs(turn2 - 1) < 1e-3)) return "the axes are no rotation";
  for (const float v : moments.front().value)
    if (!(v >= 0)) return "the fluence is negative";
  for (const float radius : r.radius)
    if (!(radius >= std::numeric_limits<float>::min())) return "a radius is not positive";
  if (!(r.error >= 0)) return "the error is negative";
  if (!(r.clearance >= 0)) return "the clearance is negative";
  if (!(r.media_share >= 0 && r.media_share <= 1.0001f))
    return "the media share is outside [0, 1]";
  return nullptr;
}

}  // namespace brume
