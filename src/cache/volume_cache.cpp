#include "cache/volume_cache.h"

#include <algorithm>
#include <cmath>
#include <map>

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
  struct Tree {
    std::vector<RecordSite> sites;
    std::vector<std::array<float, 3>> halves;
  };
  std::map<std::pair<int, int>, Tree> trees;  // By layer and octave of the widest radius.
  kernels_.resize(all_.size());
  for (std::uint32_t i = 0; i < all_.size(); ++i) {
    const VolumeRecord& r = all_.records[i];
    if (record_fault(r, all_.moments_of(i))) continue;
    Kernel& kernel = kernels_[i];
    for (int a = 0; a < 3; ++a) {
      kernel.position[a] = r.position[a];
      kernel.inverse_radius[a] = 1 / r.radius[a];
    }
    kernel.is_turned =
        std::abs(r.axes[0]) != 1 && !(r.radius[0] == r.radius[1] && r.radius[1] == r.radius[2]);
    const float widest = std::max({r.radius[0], r.radius[1], r.radius[2]});
    RecordSite site{{}, {0, 0, 1}, {1, 0, 0}, {widest, widest}, i};
    std::copy_n(r.position, 3, site.position);
    Tree& tree = trees[{r.layer(), std::ilogb(widest)}];
    tree.sites.push_back(site);
    if (kernel.is_turned)
      tree.halves.push_back({widest, widest, widest});
    else
      tree.halves.push_back({r.radius[0], r.radius[1], r.radius[2]});
  }
  for (const auto& [of, tree] : trees) {
    const auto layer = static_cast<std::size_t>(of.first);
    if (layers_.size() <= layer) layers_.resize(layer + 1);
    layers_[layer].emplace_back(tree.sites, tree.halves);
  }
}

double VolumeCache::squared_error_at(std::uint32_t record, const Vec3d& p,
                                     double most_inverse) const {
  const Kernel& kernel = kernels_[record];
  Vec3d d = p - vector(kernel.position);
  if (kernel.is_turned) d = along_axes(all_.records[record].axes, d);
  double sum = 0;
  for (int a = 0; a < 3; ++a) {
    const double e = d[a] * std::min(double(kernel.inverse_radius[a]), most_inverse);
    sum += e * e;
  }
  return sum;
}

std::vector<std::pair<std::uint32_t, double>> VolumeCache::explain(const VolumeQuery& query) const {
  std::vector<std::pair<std::uint32_t, double>> answers;
  if (query.layer < 0 || query.layer >= static_cast<int>(layers_.size())) return answers;
  const Vec3d p = query.position - origin_;
  const double most_inverse = query.min_radius > 0 ? 1 / query.min_radius : kInfinity;
  for (const RecordIndex& index : layers_[static_cast<std::size_t>(query.layer)])
    index.visit(p, query.min_radius, [&](const RecordSite& site) {
      const double square = squared_error_at(site.record, p, most_inverse);
      if (square < 1) answers.emplace_back(site.record, 1 - std::sqrt(square));
      return true;
    });
  std::sort(answers.begin(), answers.end());
  return answers;
}

}  // namespace brume
