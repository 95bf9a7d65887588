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

}  // namespace brume
