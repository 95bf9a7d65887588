#include "cache/volume_cache.h"

#include <algorithm>

namespace brume {
namespace {

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

// q^-1 p q: the displacement along the axes of a record's radii.
Vec3d along_axes(const float* q, const Vec3d& p) {
  const Vec3d v(-double(q[1]), -double(q[2]), -double(q[3]));
  const Vec3d t = v.cross(p) * 2;
  return p + t * double(q[0]) + v.cross(t);
}

double clamped(double value, double limit) {
  if (!(value >= 0)) return 0;  // NaN too.
  return value <= limit ? value : limit;
}

}  // namespace

VolumeCache::VolumeCache(VolumeRecords records, const Vec3d& origin)
    : all_(std::move(records)), origin_(origin) {
  if (!std::is_sorted(all_.records.begin(), all_.records.end(), VolumeRecordOrder())) all_.sort();
  std::vector<std::vector<RecordSite>> sites;
  for (std::uint32_t i = 0; i < all_.size(); ++i) {
    const VolumeRecord& r = all_.records[i];
    if (record_fault(r, all_.moments_of(i))) continue;
    const auto l = static_cast<std::size_t>(r.layer());
    if (sites.size() <= l) sites.resize(l + 1);
    const float widest = std::max({r.radius[0], r.radius[1], r.radius[2]});
    RecordSite site{{}, {0, 0, 1}, {1, 0, 0}, {widest, widest}, i};
    std::copy_n(r.position, 3, site.position);
    sites[l].push_back(site);
  }
  for (std::vector<RecordSite>& of_layer : sites) layers_.emplace_back(std::move(of_layer));
}

const RecordIndex* VolumeCache::layer(int layer) const {
  const auto i = static_cast<std::size_t>(layer);
  return layer >= 0 && i < layers_.size() ? &layers_[i] : nullptr;
}

double VolumeCache::error_at(const RecordSite& site, const Vec3d& p, double min_radius) const {
  const Vec3d d = p - vector(site.position);
  const VolumeRecord& r = all_.records[site.record];
  if (r.radius[0] == r.radius[1] && r.radius[1] == r.radius[2])
    return d.length() / std::max(double(r.radius[0]), min_radius);
  Vec3d e = along_axes(r.axes, d);
  for (int a = 0; a < 3; ++a) e[a] /= std::max(double(r.radius[a]), min_radius);
  return e.length();
}

std::vector<std::pair<std::uint32_t, double>> VolumeCache::explain(const VolumeQuery& query) const {
  std::vector<std::pair<std::uint32_t, double>> answers;
  const RecordIndex* index = layer(query.layer);
  if (!index) return answers;
  const Vec3d p = query.position - origin_;
  index->visit(p, query.min_radius, [&](const RecordSite& site) {
    const double error = error_at(site, p, query.min_radius);
    if (error < 1) answers.emplace_back(site.record, 1 - error);
    return true;
  });
  std::sort(answers.begin(), answers.end());
  return answers;
}

bool VolumeCache::covers(const VolumeQuery& query, double max_error) const {
  const RecordIndex* index = layer(query.layer);
  if (!index) return false;
  const Vec3d p = query.position - origin_;
  bool is_covered = false;
  index->visit(p, query.min_radius, [&](const RecordSite& site) {
    is_covered = error_at(site, p, query.min_radius) < max_error;
    return !is_covered;
  });
  return is_covered;
}

InterpolatedScatter VolumeCache::scatter(const VolumeQuery& query,
                                         std::span<const double> weights) const {
  InterpolatedScatter result;
  const Vec3d p = query.position - origin_;
  RgbD first, sum;
  double of_all = 0;
  for (const auto& [i, weight] : explain(query)) {
    const Vec3d d = p - vector(all_.records[i].position);
    const std::span<const VolumeMoment> moments = all_.moments_of(i);
    RgbD here, there;
    for (std::size_t k = 0; k < moments.size(); ++k)
      for (int c = 0; c < 3; ++c) {
        here[c] += weights[k] * moments[k].value[c];
        there[c] += weights[k] * vector(moments[k].gradient + 3 * c).dot(d);
      }
    RgbD kept;
    for (int c = 0; c < 3; ++c) {
      kept[c] = clamped(here[c] + there[c], 2 * std::max(0.0, here[c]));
      result.clamped |= kept[c] != here[c] + there[c];
    }
    // Mean = v0 + sum w (v - v0) / sum w: equal values come back as they are, bit for bit.
    if (result.records++ == 0) first = kept;
    sum += (kept - first) * weight;
    of_all += weight;
  }
  if (result.records > 0)
    for (int c = 0; c < 3; ++c)
      result.value[c] =
          clamped(first[c] + sum[c] / of_all, std::numeric_limits<double>::max());
  return result;
}

}  // namespace brume
