#include "render/medium_tracking.h"

namespace brume {
namespace {

// A stretch of ray along which density lies in [low, high].
struct Stretch {
  double t0 = 0, t1 = 0, low = 0, high = 0;
};

// The bricks of one grid along a ray, empty ones left out; or one stretch for a constant.
class Stretches {
 public:
  static Stretches of_grid(const BrickGrid& grid, const Ray& ray, Interval t) {
    Stretches s;
    if (grid.is_empty()) return s;
    s.grid_ = &grid;
    const Vec3d first(grid.brick_min());
    s.o_ = grid.world_to_index().point(ray.origin) / BrickGrid::kCells - first;
    s.d_ = grid.world_to_index().vector(ray.direction) / BrickGrid::kCells;
    const Box3d& bounds = grid.index_bounds();
    const Box3d box(bounds.min / BrickGrid::kCells - first, bounds.max / BrickGrid::kCells - first);
    const Interval inside = clip({s.o_, s.d_}, box, t);
    if (inside.is_empty()) return s;
    s.t_ = inside.begin;
    s.t_end_ = inside.end;
    const Vec3d p = s.o_ + s.d_ * s.t_;
    for (int a = 0; a < 3; ++a) {
      s.brick_[a] = std::clamp(int(std::floor(p[a])), 0, grid.brick_count()[a] - 1);
      s.set_exit(a);
    }
    return s;
  }
  static Stretches of_constant(const Box3d& box, const Ray& ray, Interval t) {
    Stretches s;
    const Interval inside = clip(ray, box, t);
    if (inside.is_empty()) return s;
    s.t_ = inside.begin;
    s.t_end_ = inside.end;
    return s;
  }

  bool next(Stretch& out) {
    while (t_ < t_end_) {
      out.t0 = t_;
      if (!grid_) {
        out.t1 = t_ = t_end_;
        out.low = out.high = 1;
        return true;
      }
      const int axis =
          exit_[0] < exit_[1] ? (exit_[0] < exit_[2] ? 0 : 2) : (exit_[1] < exit_[2] ? 1 : 2);
      const BrickGrid::ValueRange range = grid_->brick_range(grid_->top(brick_));
      out.t1 = std::clamp(exit_[axis], t_, t_end_);
      t_ = out.t1;
      brick_[axis] += d_[axis] > 0 ? 1 : -1;
      if (brick_[axis] < 0 || brick_[axis] >= grid_->brick_count()[axis])
        t_ = t_end_;
      else
        set_exit(axis);
      if (out.t1 > out.t0 && range.max > 0) {
        // Interpolated values may leave the range of the nodes by a rounding error.
        out.low = range.min * (1 - 1e-6);
        out.high = range.max * (1 + 1e-6);
        return true;
      }
    }
    return false;
  }

 private:
  void set_exit(int a) {
    exit_[a] = d_[a] > 0   ? (brick_[a] + 1 - o_[a]) / d_[a]
               : d_[a] < 0 ? (brick_[a] - o_[a]) / d_[a]
                           : kInfinity;
  }

  const BrickGrid* grid_ = nullptr;
  Vec3d o_{0.0}, d_{0.0};  // The ray in bricks.
  Vec3i brick_{0};
  double exit_[3] = {0, 0, 0};  // Where the ray leaves the brick on each axis.
  double t_ = 0, t_end_ = 0;
};

Stretches density_stretches(const Volume& volume, const Ray& ray, Interval t) {
  return volume.is_homogeneous() ? Stretches::of_constant(volume.bounds, ray, t)
                                 : Stretches::of_grid(*volume.density, ray, t);
}

double exponential(RandomStream& random) { return -std::log1p(-random.uniform()); }

// Below this weight every second path is dropped and the others doubled.
constexpr double kRouletteBelow = 0.02;

// A channel that is nearly gone while another is not plays by itself, so that it ends.
constexpr double kChannelRouletteBelow = 1e-3;

// False: dropped.
bool play_roulette(RgbD& weight, RandomStream& random) {
  for (int c = 0; c < 3; ++c)
    if (weight[c] > 0 && weight[c] < kChannelRouletteBelow * max_component(weight))
      weight[c] = random.uniform() < 0.5 ? 2 * weight[c] : 0;
  const double most = max_component(weight);
  if (most > kRouletteBelow) return true;
  if (!(most > 0) || random.uniform() < 0.5) {
    weight = {};
    return false;
  }
  weight *= 2;
  return true;
}

// Tentative collisions with emission grids come this many voxels apart.
constexpr double kEmissionVoxels = 4;
// A sweep has at least about this many tentative collisions on its way through all of the medium,
// so that thin smoke is met by most paths.
constexpr double kSweepCollisions = 3;
// And this many times as many as delta tracking needs, which costs a lookup each and spares noise.
constexpr double kSweepBoost = 2;

}  // namespace

// Tentative collisions of one ray with one volume's density, or with one channel of its emission
// grid.
class MediumTracker::Process {
 public:
  // Of density.
  Process(const Volume& v, int index, const Ray& ray, Interval range, double boost, double min_rate)
      : volume(&v),
        volume_index(index),
        stretches_(density_stretches(v, ray, range)),
        boost_(boost),
        rate_per_density_(max_component(v.sigma_t()) * boost),
        min_rate_(min_rate) {}
  // Of an emission grid; `channel` -1: all three.
  Process(const Volume& v, const BrickGrid& emission, int emission_channel, const Ray& ray,
          Interval range)
      : volume(&v),
        emission_grid(&emission),
        channel(emission_channel),
        stretches_(Stretches::of_grid(emission, ray, range)),
        boost_(0),
        rate_per_density_(0),
        min_rate_(1 / (kEmissionVoxels * emission.voxel_size())) {}

  void start(RandomStream& random) {
    left_ = exponential(random);
    advance(random);
  }
  // To the next collision; t is infinite where there is none.
  void advance(RandomStream& random) {
    while (true) {
      const double depth = rate > 0 ? rate * (stretch_.t1 - at_) : 0;
      if (left_ < depth) {
        t = at_ += left_ / rate;
        left_ = exponential(random);
        return;
      }
      if (depth > 0) left_ -= depth;
      if (!stretches_.next(stretch_)) {
        t = kInfinity;
        stretch_.t1 = at_ = 0;
        return;
      }
      at_ = stretch_.t0;
      rate = std::max(rate_per_density_ * stretch_.high, min_rate_);
    }
  }
  // From here on only channels with weight collide. Those that a dense volume has put out would
  // else keep one that it lets through busy for ever. Call it at a collision, before advance().
  void forget_dark_channels(const RgbD& weight) {
    if (weight.r > 0 && weight.g > 0 && weight.b > 0) return;
    const RgbD sigma_t = volume->sigma_t();
    double largest = 0;
    for (int c = 0; c < 3; ++c)
      if (weight[c] > 0) largest = std::max(largest, sigma_t[c]);
    rate_per_density_ = largest * boost_;
    if (largest == 0) min_rate_ = 0;
    rate = std::max(rate_per_density_ * stretch_.high, min_rate_);
  }

  const Volume* volume;
  int volume_index = -1;
  const BrickGrid* emission_grid = nullptr;
  int channel = -1;
  double t = kInfinity, rate = 0;

  // Inside a stretch a homogeneous volume is 1, even where rounding puts p on the wrong side of its
  // wall: a dense one would never get away from there.
  double density_at(const Vec3d& p) const {
    return volume->is_homogeneous() ? 1 : volume->density_at(p);
  }
  RgbD emission_at(const Vec3d& p) const {
    const double value = emission_grid->sample(emission_grid->world_to_index().point(p));
    const RgbD color = RgbD(volume->emission.color) * (volume->emission.scale * value);
    if (channel < 0) return color;
    RgbD one;
    one[channel] = color[channel];
    return one;
  }

 private:
  Stretches stretches_;
  Stretch stretch_;
  double boost_, rate_per_density_, min_rate_, at_ = 0, left_ = 0;
};

MediumTracker::MediumTracker(const Medium& medium) : medium_(&medium) {
  if (!medium.is_vacuum() && !medium.is_unbounded())
    min_rate_ = kSweepCollisions / (medium.bounds().max - medium.bounds().min).length();
}

MediumTracker::~MediumTracker() = default;
MediumTracker::MediumTracker(MediumTracker&&) noexcept = default;

void MediumTracker::start(const Ray& ray, double t_end, double boost, double min_rate,
                          RandomStream& random) {
  processes_.clear();
  const Interval t{0, t_end};
  for (std::size_t i = 0; i < medium_->volumes().size(); ++i) {
    const Volume& v = medium_->volumes()[i];
    if (!is_black(v.sigma_t())) processes_.emplace_back(v, int(i), ray, t, boost, min_rate);
    if (v.emission.mode != Emission::Mode::Grid) continue;
    const auto& grids = v.emission.grid;
    for (std::size_t c = 0; c < grids.size(); ++c)
      if (!grids[c]->is_empty())
        processes_.emplace_back(v, *grids[c], grids.size() == 1 ? -1 : int(c), ray, t);
  }
  for (Process& p : processes_) p.start(random);
}

MediumTracker::Process* MediumTracker::earliest() {
  Process* first = nullptr;
  for (Process& p : processes_)
    if (p.t < kInfinity && (!first || p.t < first->t)) first = &p;
  return first;
}

RgbD MediumTracker::transmittance(const Ray& ray, double t_end, RandomStream& random) {
  RgbD weight(1.0);
  for (const Volume& v : medium_->volumes()) {
    const RgbD sigma_t = v.sigma_t();
    const double largest = max_component(sigma_t);
    if (!(largest > 0)) continue;
    Stretches stretches = density_stretches(v, ray, {0, t_end});
    Stretch s;
    double left = exponential(random);
    while (stretches.next(s)) {
      // What every point of the brick has is taken out exactly; collisions only see the rest
      // [NSJ14].
      for (int c = 0; c < 3; ++c)
        if (sigma_t[c] > 0 && s.low > 0) weight[c] *= std::exp(-sigma_t[c] * s.low * (s.t1 - s.t0));
      if (!play_roulette(weight, random)) return weight;
      const double range = s.high - s.low, rate = range * largest;
      // No range but rounding: a constant tile.
      if (range <= 4e-6 * s.high) continue;
      double at = s.t0;
      while (true) {
        const double depth = rate * (s.t1 - at);
        if (left >= depth) {
          left -= depth;
          break;
        }
        at += left / rate;
        left = exponential(random);
        ++lookups_;
        const double above = std::max(0.0, v.density_at(ray.at(at)) - s.low) / rate;
        for (int c = 0; c < 3; ++c) weight[c] *= std::max(0.0, 1 - sigma_t[c] * above);
        if (!play_roulette(weight, random)) return weight;
      }
    }
  }
  return weight;
}

Sweep MediumTracker::sweep(const Ray& ray, double t_end, const RgbD& path_weight,
                           RandomStream& random) {
  Sweep result;
  RgbD weight = path_weight;
  result.transmittance = weight;
  if (medium_->is_vacuum()) return result;
  start(ray, t_end, kSweepBoost, min_rate_, random);
  double total = 0, chosen = 0;
  while (Process* process = earliest()) {
    const Volume& v = *process->volume;
    const Vec3d p = ray.at(process->t);
    ++lookups_;
    if (process->emission_grid) {
      result.emission += weight * process->emission_at(p) / process->rate;
      process->advance(random);
      continue;
    }
    const double density = process->density_at(p);
    if (density > 0) {
      if (v.emits() && v.emission.mode != Emission::Mode::Grid)
        result.emission += weight * v.emission_at(p) / process->rate;
      const RgbD scattered = weight * v.sigma_s_at(p) * (density / process->rate);
      const double q = mean_component(scattered);
      if (q > 0) {
        total += q;
        if (random.uniform() * total < q) {
          result.scatter = {true, process->t, process->volume_index, scattered};
          chosen = q;
        }
      }
      const RgbD sigma_t = v.sigma_t();
      for (int c = 0; c < 3; ++c)
        weight[c] *= std::max(0.0, 1 - sigma_t[c] * density / process->rate);
      if (!play_roulette(weight, random)) break;
    }
    process->forget_dark_channels(weight);
    process->advance(random);
  }
  result.transmittance = weight;
  if (result.scatter.is_set) result.scatter.weight *= total / chosen;
  return result;
}

Flight MediumTracker::fly(const Ray& ray, double t_end, const RgbD& path_weight,
                          RandomStream& random) {
  Flight result;
  result.weight = path_weight;
  if (medium_->is_vacuum()) return result;
  start(ray, t_end, 1, 0, random);
  RgbD& weight = result.weight;
  while (Process* process = earliest()) {
    const Volume& v = *process->volume;
    const Vec3d p = ray.at(process->t);
    const double rate = process->rate;
    ++lookups_;
    if (process->emission_grid) {
      result.emission += weight * process->emission_at(p) / rate;
      process->advance(random);
      continue;
    }
    const double density = process->density_at(p);
    if (density > 0) {
      if (v.emits() && v.emission.mode != Emission::Mode::Grid)
        result.emission += weight * v.emission_at(p) / rate;
      // Scatter or go on, in proportion to what each is worth to this path; absorption is weight.
      RgbD scatter = weight * v.sigma_s_at(p) * (density / rate), pass = weight;
      const RgbD sigma_t = v.sigma_t();
      for (int c = 0; c < 3; ++c) pass[c] *= std::max(0.0, 1 - sigma_t[c] * density / rate);
      const double a = mean_component(scatter), b = mean_component(pass);
      if (!(a + b > 0)) {
        weight = {};
        return result;
      }
      const double probability = a / (a + b);
      if (random.uniform() < probability) {
        weight = scatter / probability;
        result.scatter = {true, process->t, process->volume_index, weight};
        return result;
      }
      weight = pass / (1 - probability);
      if (!play_roulette(weight, random)) return result;
    }
    process->forget_dark_channels(weight);
    process->advance(random);
  }
  return result;
}

ScatterPoint MediumTracker::scatter_at(const Vec3d& p, double u) {
  ScatterPoint point;
  double total = 0, chosen = 0;
  for (std::size_t i = 0; i < medium_->volumes().size(); ++i) {
    const Volume& v = medium_->volumes()[i];
    if (!v.scatters()) continue;
    ++lookups_;
    const double density = v.density_at(p);
    if (!(density > 0)) continue;
    const RgbD scattered = v.sigma_s_at(p) * density;
    const double q = mean_component(scattered);
    if (!(q > 0)) continue;
    total += q;
    const double share = q / total;
    if (u < share) {
      point = {true, 0, int(i), scattered};
      chosen = q;
      u /= share;
    } else {
      u = (u - share) / (1 - share);
    }
  }
  if (point.is_set) point.weight *= total / chosen;
  return point;
}

}  // namespace brume
