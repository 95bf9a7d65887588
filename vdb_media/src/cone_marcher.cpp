#include "vdb_media/cone_marcher.h"

#include "march.h"

namespace brume {
namespace {

// A step that may be this thick is cut, but not below a voxel: what one sample says of it goes into
// an exponential.
constexpr double kMostDepth = 0.5;
// Voxels are this much finer than steps: coarser ones blur what a ray of its own would see.
constexpr double kVoxelsPerStep = 4;
// What lies behind so many mean free paths does not arrive.
constexpr double kEndOfSight = 40;

double least_component(const RgbD& c) { return std::min(c.r, std::min(c.g, c.b)); }

}  // namespace

void ConeMarcher::begin(const Vec3d& origin, std::span<const double> boundaries, double width) {
  origin_ = origin;
  boundaries_.assign(boundaries.begin(), boundaries.end());
  const auto& volumes = medium_->volumes();
  tracks_.resize(volumes.size());
  for (std::size_t v = 0; v < volumes.size(); ++v)
    if (!volumes[v].is_homogeneous())
      add_steps(volumes[v], medium_->pyramid(static_cast<int>(v)), width, tracks_[v]);
}

double ConeMarcher::step_length(const Volume& volume, const BrickPyramid& pyramid,
                                double wanted) const {
  const double least = volume.density->voxel_size() * std::max(1.0, step_voxels_);
  const double sigma_t = max_component(volume.sigma_t());
  while (wanted > least &&
         sigma_t * pyramid.level(pyramid.level_for(wanted)).range().max * wanted > kMostDepth)
    wanted *= 0.5;
  return std::max(wanted, least);
}

void ConeMarcher::add_steps(const Volume& volume, const BrickPyramid& pyramid, double width,
                            Track& track) const {
  track.steps.clear();
  int coarsest = 0;
  for (std::size_t s = 0; s + 1 < boundaries_.size(); ++s) {
    const double begin = boundaries_[s], end = boundaries_[s + 1];
    const double wanted = step_length(volume, pyramid, width * 0.5 * (begin + end));
    const int count = std::max(1, static_cast<int>(std::lround((end - begin) / wanted)));
    const double length = (end - begin) / count;
    const int level = pyramid.level_for(wanted / kVoxelsPerStep);
    coarsest = std::max(coarsest, level);
    for (int i = 0; i < count; ++i)
      track.steps.push_back({begin + i * length, i + 1 < count ? begin + (i + 1) * length : end,
                             static_cast<int>(s), level});
  }
  track.levels.clear();
  track.box = Box3d();
  for (int l = 0; l <= coarsest; ++l) {
    const BrickGrid& grid = pyramid.level(l);
    track.levels.push_back({&grid, grid.world_to_index().point(origin_)});
    const double scale = static_cast<double>(1 << l);
    track.box.extendBy(Box3d(grid.index_bounds().min * scale, grid.index_bounds().max * scale));
  }
}

template <bool kGradients>
void ConeMarcher::march_grid(int volume, const Ray& ray, double offset,
                             std::span<const double> jitter, MarchCounters& counters) {
  const Volume& v = medium_->volumes()[static_cast<std::size_t>(volume)];
  const Track& track = tracks_[static_cast<std::size_t>(volume)];
  const Vec3d direction = v.density->world_to_index().vector(ray.direction);
  const Interval inside =
      clip({track.levels.front().origin, direction}, track.box, {edges_.front(), edges_.back()});
  const RgbD sigma_t = v.sigma_t();
  const double mean_sigma_t = mean_component(sigma_t), t_end = edges_.back();
  const double enough = kEndOfSight / least_component(sigma_t);
  ShellDensity* shells = &shells_[volume * stride_];
  double depth = 0;
  Vec3d i0(0.0), i1(0.0);
  std::size_t k = 0;
  if (!inside.is_empty()) {
    ++counters.rays;
    while (k < track.steps.size() && track.steps[k].end <= inside.begin) ++k;
  }
  int shell = 0;
  const auto finish_shell = [&] {
    add_depth(tau_[shell + 1], sigma_t, depth);
    if constexpr (kGradients) {
      i0_[volume * stride_ + shell + 1] = i0;
      i1_[volume * stride_ + shell + 1] = i1;
    }
    ++shell;
  };
  while (!inside.is_empty() && k < track.steps.size() && track.steps[k].begin < inside.end &&
         depth < enough) {
    while (shell < track.steps[k].shell) finish_shell();
    depths_.clear();
    places_.clear();
    double in_shell = 0;
    for (; k < track.steps.size() && track.steps[k].shell == shell &&
           track.steps[k].begin < inside.end;
         ++k) {
      const Step& step = track.steps[k];
      const double length = std::min(step.end, t_end) - step.begin;
      const double t = step.begin + offset * length;
      const Level& level = track.levels[static_cast<std::size_t>(step.level)];
      const double scale = 1.0 / (1 << step.level);
      const Vec3d p = level.origin + direction * (t * scale);
      ++counters.segments;
      if constexpr (kGradients) {
        const BrickGrid::ValueGradient g = level.grid->sample_gradient(p);
        depths_.push_back(g.value * length);
        i0 += g.gradient * (length * scale);
        i1 += g.gradient * (length * scale * t);
      } else {
        depths_.push_back(level.grid->sample(p) * length);
      }
      places_.push_back(t);
      in_shell += depths_.back();
    }
    if (in_shell > 0) {
      shells[shell].integral = in_shell;
      std::size_t at = 0;
      if (depths_.size() > 1) {
        double left = in_shell * draw_depth_fraction(jitter[shell], mean_sigma_t * in_shell);
        while (at + 1 < depths_.size() && left >= depths_[at]) left -= depths_[at++];
      }
      shells[shell].t_sample = places_[at];
      depth += in_shell;
    }
  }
  while (shell < shell_count_) finish_shell();
}

void ConeMarcher::march(const Vec3d& direction, double t_end, double offset,
                        std::span<const double> jitter, bool want_gradients,
                        MarchCounters& counters) {
  if (!MarchedShells::begin(*medium_, boundaries_, t_end, jitter, want_gradients)) return;
  const Ray ray{origin_, direction};
  const auto& volumes = medium_->volumes();
  for (std::size_t v = 0; v < volumes.size(); ++v) {
    if (volumes[v].is_homogeneous())
      march_homogeneous(volumes[v], static_cast<int>(v), ray, jitter, counters);
    else if (want_gradients)
      march_grid<true>(static_cast<int>(v), ray, offset, jitter, counters);
    else
      march_grid<false>(static_cast<int>(v), ray, offset, jitter, counters);
  }
}

}  // namespace brume
