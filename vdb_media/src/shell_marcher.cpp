#include <cmath>

#include "march.h"
#include "vdb_media/ray_marcher.h"

namespace brume {
namespace {

// Where in a segment, from 0 to 1, the integral of mean + change (s - 1/2) reaches `part` of a
// length.
double solve_segment(double mean, double change, double part) {
  const double c = std::clamp(change, -2 * mean, 2 * mean);  // Not below 0 at either end.
  const double a = mean - 0.5 * c;
  const double below = a + std::sqrt(std::max(0.0, a * a + 2 * c * part));
  return below > 0 ? std::min(1.0, 2 * part / below) : 0;
}

}  // namespace

struct ShellMarcher::Scratch {
  std::vector<double> edges;  // Of the shells that are marched, the last one cut at t_end.
  std::vector<double> cuts;   // The same in a grid's parameters.
  std::vector<Span> spans;
  Segments segments{64};
  // What view() shows, its rows as long as stride_.
  std::vector<float> integral, sample, transmittance, end;
  std::array<std::vector<float>, 3> gradient, moment;
};

ShellMarcher::ShellMarcher(const Medium& medium, MarchOptions options)
    : medium_(&medium), options_(options), scratch_(std::make_unique<Scratch>()) {}
ShellMarcher::~ShellMarcher() = default;
ShellMarcher::ShellMarcher(ShellMarcher&&) noexcept = default;
ShellMarcher& ShellMarcher::operator=(ShellMarcher&&) noexcept = default;
ShellMarcher::ShellMarcher(const ShellMarcher& other)
    : ShellMarcher(*other.medium_, other.options_) {}
ShellMarcher& ShellMarcher::operator=(const ShellMarcher& other) {
  return *this = ShellMarcher(other);
}

// What the grid of one volume adds: cuts spans at the shells' edges, then sums segments shell by
// shell.
template <bool kGradients>
void ShellMarcher::march_grid(int volume, const Ray& ray, std::span<const double> jitter,
                              MarchCounters& counters) {
  const Volume& v = medium_->volumes()[volume];
  const BrickGrid& grid = *v.density;
  const auto entry = enter(grid, ray, {scratch_->edges.front(), scratch_->edges.back()});
  if (!entry) return;
  ++counters.rays;

  std::vector<double>& cuts = scratch_->cuts;
  std::vector<Span>& spans = scratch_->spans;
  const double base = entry->ray.base;
  cuts.clear();
  for (const double e : scratch_->edges) cuts.push_back(e - base);
  spans.clear();
  std::size_t cut = 1;
  walk_bricks(grid, *entry, [&](std::int32_t top, const Vec3i& corner, double begin, double end) {
    while (cut < cuts.size() && cuts[cut] <= begin) ++cut;
    Span span = make_span(grid, top, corner, begin, end);
    while (true) {
      span.first_cut = std::int32_t(cut);
      while (cut < cuts.size() && cuts[cut] < end && cut < std::size_t(span.first_cut) + kMaxCuts)
        ++cut;
      span.cut_count = std::int32_t(cut) - span.first_cut;
      const bool more = cut < cuts.size() && cuts[cut] < end;
      span.end = more ? cuts[cut] : end;
      if (span.begin < span.end) spans.push_back(span);
      if (!more) return;
      span.begin = cuts[cut++];
    }
  });
  if (spans.empty()) return;

  const Field field = make_field(grid, entry->ray, options_);
  Segments& s = scratch_->segments;
  s.reserve(spans.size());
  collect(field, spans.data(), int(spans.size()), cuts.data(), s);
  evaluate(field, kGradients ? Want::Gradients : Want::MeanAndChange, s);
  set_tiles(s);
  counters.segments += s.count;

  const double mean_sigma_t = mean_component(v.sigma_t());
  const RgbD sigma_t = v.sigma_t();
  ShellDensity* shells = &shells_[volume * stride_];
  double depth = 0;
  Vec3d i0(0.0), i1(0.0);  // i1 of the grid's own parameter, which starts at `base`.
  int i = 0;
  for (int shell = 0; shell < shell_count_; ++shell) {
    // One shell's segments are summed in registers.
    const int first = i;
    const double end = shell + 1 < shell_count_ ? cuts[shell + 1] : kInfinity;
    double in_shell = 0, gx = 0, gy = 0, gz = 0, mx = 0, my = 0, mz = 0;
    for (; i < s.count && s.begin[i] < end; ++i) {
      in_shell += double(s.mean[i]) * s.length[i];
      if constexpr (kGradients) {
        gx += double(s.gradient[0][i]), gy += double(s.gradient[1][i]);
        gz += double(s.gradient[2][i]), mx += double(s.moment[0][i]);
        my += double(s.moment[1][i]), mz += double(s.moment[2][i]);
      }
    }
    if (in_shell > 0) {
      shells[shell].integral = in_shell;
      const double target = in_shell * draw_depth_fraction(jitter[shell], mean_sigma_t * in_shell);
      double before = 0;
      int at = first;
      for (; at + 1 < i; ++at) {
        const double after = before + double(s.mean[at]) * s.length[at];
        if (after >= target) break;
        before = after;
      }
      const double part = s.length[at] > 0 ? std::max(0.0, target - before) / s.length[at] : 0;
      const double t =
          base + s.begin[at] + s.length[at] * solve_segment(s.mean[at], s.change[at], part);
      shells[shell].t_sample = std::clamp(t, scratch_->edges[shell], scratch_->edges[shell + 1]);
      depth += in_shell;
    }
    add_depth(tau_[shell + 1], sigma_t, depth);
    if constexpr (kGradients) {
      i0 += Vec3d(gx, gy, gz);
      i1 += Vec3d(mx, my, mz);
      i0_[volume * stride_ + shell + 1] = i0;
      i1_[volume * stride_ + shell + 1] = i1 + i0 * base;
    }
  }
}

void ShellMarcher::march_homogeneous(int volume, const Ray& ray, std::span<const double> jitter,
                                     MarchCounters& counters) {
  const Volume& v = medium_->volumes()[volume];
  const std::vector<double>& edges = scratch_->edges;
  const Interval inside = clip_homogeneous(v, ray, {edges.front(), edges.back()});
  if (inside.is_empty()) return;
  ++counters.rays;
  const RgbD sigma_t = v.sigma_t();
  const double mean_sigma_t = mean_component(sigma_t);
  double depth = 0;
  for (int shell = 0; shell < shell_count_; ++shell) {
    const double begin = std::max(edges[shell], inside.begin);
    const double length = std::min(edges[shell + 1], inside.end) - begin;
    if (length > 0) {
      ++counters.segments;
      depth += length;
      shells_[volume * stride_ + shell] = {
          length, begin + length * draw_depth_fraction(jitter[shell], mean_sigma_t * length)};
    }
    add_depth(tau_[shell + 1], sigma_t, depth);
  }
}

void ShellMarcher::march(const Ray& ray, std::span<const double> boundaries, double t_end,
                         std::span<const double> jitter, bool want_gradients,
                         MarchCounters& counters) {
  const std::size_t volumes = medium_->volumes().size();
  stride_ = boundaries.size();
  shells_.assign(volumes * stride_, ShellDensity{});
  tau_.assign(stride_, RgbD());
  has_gradients_ = want_gradients;
  if (want_gradients) {
    i0_.assign(volumes * stride_, Vec3d(0.0));
    i1_.assign(volumes * stride_, Vec3d(0.0));
  }
  std::vector<double>& edges = scratch_->edges;
  edges.clear();
  for (std::size_t i = 0; i + 1 < boundaries.size() && boundaries[i] < t_end; ++i)
    edges.push_back(boundaries[i]);
  shell_count_ = int(edges.size());
  if (shell_count_ == 0) return;
  edges.push_back(std::min(boundaries[shell_count_], t_end));

  for (std::size_t v = 0; v < volumes; ++v) {
    // Where a volume has no density its sample is as good anywhere.
    for (int s = 0; s < shell_count_; ++s)
      shells_[v * stride_ + s].t_sample = edges[s] + (edges[s + 1] - edges[s]) * jitter[s];
    if (medium_->volumes()[v].is_homogeneous())
      march_homogeneous(int(v), ray, jitter, counters);
    else if (want_gradients)
      march_grid<true>(int(v), ray, jitter, counters);
    else
      march_grid<false>(int(v), ray, jitter, counters);
  }
}

MarchedShells ShellMarcher::view() {
  Scratch& s = *scratch_;
  MarchedShells view;
  view.shell_count_ = shell_count_;
  view.rows_ = int(stride_);
  view.channel_count_ = 3;
  s.integral.clear();
  s.sample.clear();
  for (const ShellDensity& shell : shells_) {
    s.integral.push_back(float(shell.integral));
    s.sample.push_back(float(shell.t_sample));
  }
  s.transmittance.assign(3 * stride_, 0);
  s.end.assign(3 * stride_, 0);
  for (int i = 0; i < shell_count_; ++i) {
    // exp(-tau) (1 - exp(-depth)) / depth: exact for a source in proportion to density.
    const RgbD depth = tau_[i + 1] - tau_[i], left = exp_neg(tau_[i]);
    for (int c = 0; c < 3; ++c)
      s.transmittance[c * stride_ + i] = float(one_minus_exp_over(depth[c]) * left[c]);
  }
  const RgbD end = exp_neg(tau_[shell_count_]);
  for (int c = 0; c < 3; ++c) s.end[c * stride_] = float(end[c]);
  view.integral_ = s.integral.data();
  view.sample_ = s.sample.data();
  view.transmittance_ = s.transmittance.data();
  view.end_ = s.end.data();
  if (!has_gradients_) return view;
  for (int a = 0; a < 3; ++a) {
    s.gradient[a].clear();
    s.moment[a].clear();
    for (const Vec3d& g : i0_) s.gradient[a].push_back(float(g[a]));
    for (const Vec3d& m : i1_) s.moment[a].push_back(float(m[a]));
    view.gradient_[a] = s.gradient[a].data();
    view.moment_[a] = s.moment[a].data();
  }
  return view;
}

}  // namespace brume
