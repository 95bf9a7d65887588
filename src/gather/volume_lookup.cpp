#include "gather/volume_lookup.h"

#include <algorithm>

namespace brume {
namespace {

// The nearest surface that a record's gather met is not quite the nearest there is: its rays have gaps.
constexpr double kCertain = 0.7;

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

}  // namespace

VolumeLookup::VolumeLookup(const World& world, const VolumeCache& cache)
    : world_(world), cache_(cache) {
  least_radius_ = kInfinity;
  for (const VolumeRecord& r : cache.all().records)
    least_radius_ = std::min<double>(least_radius_, *std::min_element(r.radius, r.radius + 3));
}

bool VolumeLookup::is_visible(const Vec3d& p, std::uint32_t record) const {
  const VolumeRecord& r = cache_.all().records[record];
  const Vec3d to = vector(r.position) + cache_.origin() - p;
  const double distance = to.length();
  if (distance < kCertain * r.clearance) return true;
  return !world_.tracer().is_occluded({p, to / distance, distance * (1 - 1e-5)});
}

void VolumeLookup::find(const Vec3d& p, std::vector<VolumePart>& parts) const {
  parts.clear();
  VolumeQuery query{kDeepVolumeLayer, p, 0};
  for (int doubling = 0; doubling <= kMostDoublings; ++doubling) {
    double sum = 0;
    for (const auto& [record, weight] : cache_.explain(query)) {
      if (!is_visible(p, record)) continue;
      parts.push_back({record, static_cast<float>(weight)});
      sum += weight;
    }
    if (sum > 0) {
      for (VolumePart& part : parts) part.weight = static_cast<float>(part.weight / sum);
      return;
    }
    parts.clear();
    query.min_radius = 2 * std::max(query.min_radius, least_radius_);
  }
}

bool VolumeLookup::covers(const Vec3d& p) const {
  for (const auto& [record, weight] : cache_.explain({kDeepVolumeLayer, p, 0}))
    if (is_visible(p, record)) return true;
  return false;
}

bool VolumeLookup::moments(const Vec3d& p, std::span<float> out) const {
  std::fill(out.begin(), out.end(), 0.0f);
  thread_local std::vector<VolumePart> parts;
  find(p, parts);
  for (const VolumePart& part : parts) {
    const std::span<const VolumeMoment> moments = cache_.all().moments_of(part.record);
    const Vec3d d = p - cache_.origin() - vector(cache_.all().records[part.record].position);
    double kept = 1;
    for (int c = 0; c < 3; ++c) {
      const double value = moments[0].value[c];
      const double change = std::abs(vector(moments[0].gradient + 3 * c).dot(d));
      if (change > value) kept = std::min(kept, value / change);
    }
    for (std::size_t k = 0; k < moments.size(); ++k)
      for (int c = 0; c < 3; ++c)
        out[3 * k + c] += static_cast<float>(
            part.weight *
            (moments[k].value[c] + kept * vector(moments[k].gradient + 3 * c).dot(d)));
  }
  return !parts.empty();
}

}  // namespace brume
