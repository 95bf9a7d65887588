#include "march.h"
#include "vdb_media/ray_marcher.h"

namespace brume {

bool MarchedShells::begin(const Medium& medium, std::span<const double> boundaries, double t_end,
                          std::span<const double> jitter, bool want_gradients) {
  const std::size_t volumes = medium.volumes().size();
  stride_ = boundaries.size();
  shells_.assign(volumes * stride_, ShellDensity{});
  tau_.assign(stride_, RgbD());
  if (want_gradients) {
    i0_.assign(volumes * stride_, Vec3d(0.0));
    i1_.assign(volumes * stride_, Vec3d(0.0));
  }
  edges_.clear();
  for (std::size_t i = 0; i + 1 < boundaries.size() && boundaries[i] < t_end; ++i)
    edges_.push_back(boundaries[i]);
  shell_count_ = int(edges_.size());
  if (shell_count_ == 0) return false;
  edges_.push_back(std::min(boundaries[edges_.size()], t_end));
  // Where a volume has no density its sample is as good anywhere.
  for (std::size_t v = 0; v < volumes; ++v)
    for (int s = 0; s < shell_count_; ++s)
      shells_[v * stride_ + s].t_sample = edges_[s] + (edges_[s + 1] - edges_[s]) * jitter[s];
  return true;
}

void MarchedShells::march_homogeneous(const Volume& volume, int index, const Ray& ray,
                                      std::span<const double> jitter, MarchCounters& counters) {
  const Interval inside = clip_homogeneous(volume, ray, {edges_.front(), edges_.back()});
  if (inside.is_empty()) return;
  ++counters.rays;
  const RgbD sigma_t = volume.sigma_t();
  const double mean_sigma_t = mean_component(sigma_t);
  double depth = 0;
  for (int shell = 0; shell < shell_count_; ++shell) {
    const double begin = std::max(edges_[shell], inside.begin);
    const double length = std::min(edges_[shell + 1], inside.end) - begin;
    if (length > 0) {
      ++counters.segments;
      depth += length;
      shells_[index * stride_ + shell] = {
          length, begin + length * draw_depth_fraction(jitter[shell], mean_sigma_t * length)};
    }
    add_depth(tau_[shell + 1], sigma_t, depth);
  }
}

}  // namespace brume
