#include "gather/gather.h"

#include "core/error.h"
#include "core/random.h"
#include "core/sampling.h"
#include "gather/direction_cells.h"
#include "gather/medium_source.h"
#include "gather/shell_sums.h"
#include "gather/surface_light.h"
#include "vdb_media/ray_marcher.h"

namespace brume {
namespace {

// Shells grow from kNearness / (1 + kNearness) of the farthest one's thickness where the point lies
// inside the medium; infinite would be even ones.
constexpr double kNearness = 0.3;
constexpr int kSourceSamples =
    8;  // Of each area light, for the source term at the receiver itself.

// What pass 1 knows of a cell: the direction, what it hit, and that hit's plane.
struct Cell {
  Vec3d w{0.0};  // World space.
  double s = kInfinity;
  Vec3d q{0.0};  // Along any direction d the hit plane lies at 1/r = q.d; 0 for a miss.
};

Vec3d perpendicular(const Vec3d& v, const Vec3d& w) { return v - w * v.dot(w); }
RgbGradient perpendicular(const RgbGradient& g, const Vec3d& w) {
  return {perpendicular(g.r, w), perpendicular(g.g, w), perpendicular(g.b, w)};
}

// 1/r at a wall between two cells: the nearer of their hit planes, extended to the wall's direction
// (gradients.md 4), and no nearer than half the nearer hit.
double inverse_wall_distance(const Cell& a, const Cell& b, const Vec3d& wall) {
  const double nearest = std::min(a.s, b.s);
  if (!(nearest < kInfinity)) return 0;
  const double inverse = std::max(a.q.dot(wall), b.q.dot(wall));
  return std::clamp(inverse, 0.0, 2 / nearest);
}

}  // namespace

const char* gradient_mode_name(GradientMode mode) {
  switch (mode) {
    case GradientMode::None:
      return "none";
    case GradientMode::WardHeckbert:
      return "ward-heckbert";
    case GradientMode::Media:
      return "media";
    case GradientMode::Full:
      return "full";
  }
  return "none";
}

GradientMode parse_gradient_mode(const std::string& name) {
  for (const GradientMode m : kGradientModes)
    if (name == gradient_mode_name(m)) return m;
  throw Error(ErrorKind::Usage, "--gradient: '" + printable(name) +
                                    "' is not a mode: use none, ward-heckbert, media or full");
}

struct Gatherer::Impl {
  Impl(const Lighting& l, const Effects& e, const GatherOptions& o)
      : lighting(l),
        world(l.world()),
        effects(e),
        options(o),
        marcher(world.medium(), march_options()),
        surfaces(l, o.gradient == GradientMode::Full),
        medium(l, e, o.gradient == GradientMode::Full),
        cells(o.cell_count()) {
    const auto& volumes = world.medium().volumes();
    for (std::size_t v = 0; v < volumes.size(); ++v)
      if (!volumes[v].is_homogeneous()) bends.push_back({static_cast<int>(v), {}});
  }

  MarchOptions march_options() const {
    MarchOptions m = lighting.march();
    if (options.step_voxels > 0) m.step_voxels = options.step_voxels;
    return m;
  }

  GatherResult gather(const GatherPoint& point, const HitLight& light, Counters& counters);
  void trace(const GatherPoint& point, const HitLight& light, Counters& counters);
  void find_walls(bool wanted);
  void choose_shells();
  void draw_jitter(int c);
  void march_cell(int c, GatherResult& result, Counters& counters);
  void add_surface(int c, GatherResult& result);
  Vec3d bend_integral(int volume, int shell, double inverse_t) const;
  RgbGradient radial_term(Counters& counters);
  RgbGradient wall_term() const;
  RgbGradient moving_medium(Counters& counters);
  GradientTerms terms_of(GradientMode mode, Counters& counters);
  double error_estimate() const;
  Ray ray_of(const Cell& seen) const { return {origin, seen.w}; }
  RandomStream stream(int of_cell, int use) const {
    return RandomStream(random_key(key, of_cell, use));
  }

  const Lighting& lighting;
  const World& world;
  Effects effects;
  GatherOptions options;
  ShellMarcher marcher;
  SurfaceLight surfaces;
  MediumSource medium;

  // Of the gather under way, kept for gradient().
  DirectionCells cells;
  Frame frame{Vec3d(0.0, 0.0, 1.0)};  // Turned about the normal at random.
  Vec3d origin{0.0};
  std::uint64_t key = 0;
  RgbD sigma_here;
  std::vector<Cell> cell;
  std::vector<Ray> rays;
  std::vector<Hit> hits;
  std::vector<RgbD> total;        // L of a cell.
  std::vector<double> inverse_r;  // 1/r at each side of a wall.
  std::vector<RgbD> phi;          // Phi of gradients.md 3, at each side of a wall.
  std::vector<double> boundaries, shell_shift, jitter;
  ShellSums shell_sums;
  std::vector<Bend> bends;  // Of volumes that are grids.
  GradientTerms full_terms;
};

// Pass 1: what each cell sees, and what surfaces send along it.
void Gatherer::Impl::trace(const GatherPoint& point, const HitLight& light, Counters& counters) {
  RandomStream turn = stream(-1, 0);
  frame = Frame(point.normal).turned(2 * kPi * turn.uniform());
  origin = point.position + point.normal * point.offset;
  const int n = cells.count();
  cell.assign(n, Cell());
  rays.resize(n);
  hits.resize(n);
  const Vec2d shift = turn.uniform2();
  for (int c = 0; c < n; ++c) {
    cell[c].w = frame.to_world(cells.direction(c, shift)).normalized();
    rays[c] = ray_of(cell[c]);
  }
  world.tracer().intersect(rays, hits);
  counters.rays += n;

  surfaces.begin(n);
  for (int c = 0; c < n; ++c) {
    const Hit& hit = hits[c];
    if (!hit.is_hit()) continue;
    cell[c].s = hit.t;
    const double height = hit.normal.dot(cell[c].w) * hit.t;
    if (height != 0) cell[c].q = hit.normal / height;
    RandomStream random = stream(c, 1);
    surfaces.add(c, hit, cell[c].w, light, random, counters);
  }
  surfaces.finish(counters);
}

void Gatherer::Impl::find_walls(bool wanted) {
  inverse_r.assign(cells.side_count(), 0);
  phi.assign(cells.side_count(), RgbD());
  if (!wanted) return;
  for (const CellWall& wall : cells.walls())
    inverse_r[wall.low_side] = inverse_r[wall.high_side] =
        inverse_wall_distance(cell[wall.low], cell[wall.high], frame.to_world(wall.middle));
}

// Boundaries common to all cells (gradients.md 5), over the part of the medium that rays can reach.
void Gatherer::Impl::choose_shells() {
  boundaries.clear();
  double farthest = 0;
  for (const Cell& c : cell) farthest = std::max(farthest, c.s);
  const Box3d& box = world.medium().bounds();
  double begin = 0, end = farthest;
  if (!world.medium().is_unbounded()) {
    Vec3d nearest = origin, far = origin;
    for (int a = 0; a < 3; ++a) {
      nearest[a] = std::clamp(origin[a], box.min[a], box.max[a]);
      far[a] = origin[a] - box.min[a] > box.max[a] - origin[a] ? box.min[a] : box.max[a];
    }
    begin = (nearest - origin).length();
    end = std::min(end, (far - origin).length());
  } else if (!(end < kInfinity)) {
    // Nothing ends the medium: what lies past 50 mean free paths does not arrive.
    const double sigma = max_component(world.medium().sigma_t_at(origin));
    end = sigma > 0 ? 50 / sigma : world.diagonal();
  }
  if (!(begin < end)) return;
  int count = options.shells;
  if (count == 0) {
    const double voxels = (end - begin) / world.medium().voxel_size();
    count = std::clamp(static_cast<int>(voxels / 2), 24, GatherOptions::kMaxAutomaticShells);
  }
  // Even steps of log(t + t0): near ones are thin, because an edge of a light shaft that lies
  // inside one is taken for its centre, and that matters as 1/t.
  const double t0 = kNearness * (end - begin), growth = std::log((end + t0) / (begin + t0));
  for (int i = 0; i < count; ++i)
    boundaries.push_back(std::max(begin, (begin + t0) * std::exp(growth * i / count) - t0));
  boundaries.push_back(end);
  jitter.resize(count);
  shell_shift.resize(count);
  RandomStream random = stream(-1, 2);
  for (double& shift : shell_shift) shift = random.uniform();
}

// Where a cell looks in its shells: each shell by itself evenly, cells one after the other a golden
// section apart, so that few of them see much of a shell.
void Gatherer::Impl::draw_jitter(int c) {
  for (std::size_t i = 0; i < jitter.size(); ++i) {
    const double u = shell_shift[i] + c * (std::numbers::phi - 1);
    jitter[i] = u - std::floor(u);
  }
}

// Pass 2 for one cell: march it, and add what its shells send.
void Gatherer::Impl::march_cell(int c, GatherResult& result, Counters& counters) {
  const Ray ray = ray_of(cell[c]);
  const DirectionCell& around = cells.cell(c);
  const double g = around.measure;
  const bool full = options.gradient == GradientMode::Full;
  RandomStream random = stream(c, 2);
  draw_jitter(c);
  MarchCounters march;
  marcher.march(ray, boundaries, cell[c].s, jitter, full && effects.heterogeneous, march);
  counters.march_rays += march.rays;
  counters.segments += march.segments;
  const int n = marcher.shell_count();
  const RgbD reaching = exp_neg(marcher.tau(n));
  const RgbD from_surface = surfaces.radiance(c) * reaching;
  total[c] = from_surface;

  shell_sums.begin(n);
  if (effects.scattering || effects.emission) {
    const auto& shells =
        medium.shells(marcher, ray, boundaries, cell[c].s, jitter, random, counters);
    RgbGradient directional;
    for (int i = 0; i < n; ++i) {
      const RgbD f = shells[i].total();
      const double inverse_t = 2 / (boundaries[i] + std::min(boundaries[i + 1], cell[c].s));
      shell_sums.add(f, inverse_t);
      if (!full || is_black(f)) continue;
      for (Bend& bend : bends)
        bend.add(f * 0.5, bend_integral(bend.volume, i, inverse_t) +
                              bend_integral(bend.volume, i + 1, inverse_t));
      if (effects.anisotropic) directional += shells[i].directional * inverse_t;
    }
    const RgbD from_shells = shell_sums.light();
    total[c] += from_shells;
    result.irradiance_media += from_shells * g;
    result.light_distance += g * luminance(shell_sums.light_over_distance());
    if (full && effects.anisotropic)
      result.terms.directional += perpendicular(directional, cell[c].w) * g;
  }
  if (!is_black(from_surface)) {
    result.irradiance_surface += from_surface * g;
    result.light_distance += g * luminance(from_surface) / cell[c].s;
  }
  if (!full || is_black(total[c])) return;
  for (int side = around.first_side; side < around.end_side; ++side)
    phi[side] = shell_sums.over_distance_up_to(inverse_r[side]) + from_surface * inverse_r[side];
  for (Bend& bend : bends) {
    if (!is_black(from_surface))
      bend.add(from_surface, bend_integral(bend.volume, n, 1 / cell[c].s));
    result.terms.grad_sigma -=
        perpendicular(bend.in_world(world.medium().volumes()[bend.volume]), cell[c].w) * g;
    bend.sum = {};
  }
  if (surfaces.has_derivatives()) {
    RgbGradient d = surfaces.direction_derivative(c);
    for (int ch = 0; ch < 3; ++ch) d[ch] *= reaching[ch] / cell[c].s;
    result.terms.directional -= perpendicular(d, cell[c].w) * g;
  }
}

// I0 - I1/t of a volume's density up to where `shell` begins, for a ray that ends at t.
Vec3d Gatherer::Impl::bend_integral(int volume, int shell, double inverse_t) const {
  return marcher.grad_integral(volume, shell) - marcher.grad_moment(volume, shell) * inverse_t;
}

// The same for a cell without medium.
void Gatherer::Impl::add_surface(int c, GatherResult& result) {
  total[c] = surfaces.radiance(c);
  if (is_black(total[c])) return;
  const double g = cells.cell(c).measure;
  result.irradiance_surface += total[c] * g;
  result.light_distance += g * luminance(total[c]) / cell[c].s;
  if (options.gradient != GradientMode::Full) return;
  const DirectionCell& around = cells.cell(c);
  for (int side = around.first_side; side < around.end_side; ++side)
    phi[side] = total[c] * inverse_r[side];
  if (surfaces.has_derivatives())
    result.terms.directional -=
        perpendicular(surfaces.direction_derivative(c), cell[c].w) * (g / cell[c].s);
}

// T1: sum of W (sigma L - Q), the transfer equation itself (gradients.md 2).
RgbGradient Gatherer::Impl::radial_term(Counters& counters) {
  RgbGradient sum;
  if (is_black(sigma_here) && !effects.emission) return sum;
  RandomStream random = stream(-1, 1);
  const SourceAtPoint source = medium.source_at(origin, kSourceSamples, random, counters);
  for (int c = 0; c < cells.count(); ++c)
    sum += outer(sigma_here * total[c] - source.towards(-cell[c].w),
                 frame.to_world(cells.cell(c).direction));
  return sum;
}

// T2: sum over walls of B (Phi_hi - Phi_lo).
RgbGradient Gatherer::Impl::wall_term() const {
  RgbGradient sum;
  for (const CellWall& wall : cells.walls())
    sum += outer(phi[wall.high_side] - phi[wall.low_side], frame.to_world(wall.moment));
  return sum;
}

// The gradient of a medium that moves with the point and that nothing occludes: the integral of
// Tr (grad Q - Q I0) - f_s I0. Serves as the comparison that [JZJ08] improves on.
RgbGradient Gatherer::Impl::moving_medium(Counters& counters) {
  RgbGradient sum;
  if (!effects.heterogeneous && !effects.scattering) return sum;
  const double h = 0.25 * std::min(world.medium().voxel_size(), 4e-3 * world.diagonal());
  const auto& volumes = world.medium().volumes();
  for (int c = 0; c < cells.count(); ++c) {
    const Ray ray = ray_of(cell[c]);
    RandomStream random = stream(c, 2);
    draw_jitter(c);
    MarchCounters march;
    marcher.march(ray, boundaries, cell[c].s, jitter, true, march);
    const int n = marcher.shell_count();
    const auto shells =
        medium.shells(marcher, ray, boundaries, cell[c].s, jitter, random, counters);
    const auto i0 = [&](int shell) {
      RgbGradient b;
      for (const Bend& bend : bends)
        b += Bend{bend.volume, outer(RgbD(1), marcher.grad_integral(bend.volume, shell))}.in_world(
            volumes[bend.volume]);
      return b;
    };
    RgbGradient d;
    for (int i = 0; i < n; ++i) {
      const double a = boundaries[i], b = std::min(boundaries[i + 1], cell[c].s);
      const RgbD f = shells[i].total();
      const RgbGradient bend = (i0(i) + i0(i + 1)) * 0.5;
      for (int ch = 0; ch < 3; ++ch) d[ch] -= bend[ch] * f[ch];
      const Vec3d p = ray.at(a + jitter[i] * (b - a));
      const RgbD weight = exp_neg((marcher.tau(i) + marcher.tau(i + 1)) * 0.5) * (b - a);
      const auto add_gradient = [&](auto&& q) {
        for (int axis = 0; axis < 3; ++axis) {
          Vec3d e(0.0);
          e[axis] = h;
          const RgbD slope = (q(p + e) - q(p - e)) / (2 * h) * weight;
          for (int ch = 0; ch < 3; ++ch) d[ch][axis] += slope[ch];
        }
      };
      if (effects.emission) add_gradient([&](const Vec3d& y) { return medium.emission_at(y); });
      if (!effects.scattering) continue;
      for (std::size_t l = 0; l < world.lights().size(); ++l) {
        const Vec2d u = random.uniform2();
        if (world.tracer().is_occluded(shadow_ray(p, world.lights()[l]->sample(p, u)))) continue;
        add_gradient([&](const Vec3d& y) {
          return medium.unshadowed(y, cell[c].w, static_cast<int>(l), u, counters);
        });
      }
    }
    const RgbD from_surface = surfaces.radiance(c) * exp_neg(marcher.tau(n));
    const RgbGradient bend = i0(n);
    for (int ch = 0; ch < 3; ++ch) d[ch] -= bend[ch] * from_surface[ch];
    sum += d * cells.cell(c).measure;
  }
  return sum;
}

// Neighbours differ by noise and by what changes between them; taking all of it for noise errs on
// the safe side.
double Gatherer::Impl::error_estimate() const {
  double sum = 0;
  for (const CellWall& wall : cells.walls()) {
    const double d = luminance(total[wall.low] - total[wall.high]) * 0.5 *
                     (cells.cell(wall.low).measure + cells.cell(wall.high).measure);
    sum += d * d / 2;
  }
  return std::sqrt(sum * cells.count() / double(cells.walls().size()));
}

GatherResult Gatherer::Impl::gather(const GatherPoint& point, const HitLight& light,
                                    Counters& counters) {
  GatherResult result;
  result.light_distance = 0;
  key = point.key;
  ++counters.gathers;
  trace(point, light, counters);
  const bool full = options.gradient == GradientMode::Full;
  find_walls(options.gradient != GradientMode::None);
  total.assign(cells.count(), RgbD());
  boundaries.clear();
  if (effects.medium) choose_shells();
  result.shells = boundaries.empty() ? 0 : static_cast<int>(boundaries.size()) - 1;
  sigma_here = effects.medium ? world.medium().sigma_t_at(origin) : RgbD();

  double inverse_distance = 0;
  for (int c = 0; c < cells.count(); ++c) {
    if (boundaries.empty())
      add_surface(c, result);
    else
      march_cell(c, result, counters);
    result.rotational += outer(total[c], frame.to_world(cells.cell(c).rotation));
    if (cell[c].s < kInfinity) inverse_distance += cells.cell(c).measure / cell[c].s;
  }
  result.irradiance = result.irradiance_surface + result.irradiance_media;
  if (full) {
    result.terms.walls = wall_term();
    if (!boundaries.empty()) result.terms.radial = radial_term(counters);
    full_terms = result.terms;
  } else {
    result.terms = terms_of(options.gradient, counters);
  }
  result.error = error_estimate();
  result.mean_distance = inverse_distance > 0 ? kPi / inverse_distance : kInfinity;
  const double light_sum = luminance(result.irradiance);
  result.light_distance = result.light_distance > 0 ? light_sum / result.light_distance : kInfinity;
  return result;
}

GradientTerms Gatherer::Impl::terms_of(GradientMode mode, Counters& counters) {
  GradientTerms terms;
  switch (mode) {
    case GradientMode::None:
      break;
    case GradientMode::Full:
      terms = full_terms;
      break;
    case GradientMode::Media:
      // All of it is the medium's change along the ray.
      if (!boundaries.empty()) terms.grad_sigma = moving_medium(counters);
      break;
    case GradientMode::WardHeckbert:
      for (int c = 0; c < cells.count(); ++c) {
        const DirectionCell& around = cells.cell(c);
        for (int side = around.first_side; side < around.end_side; ++side)
          phi[side] = total[c] * inverse_r[side];
      }
      terms.walls = wall_term();
  }
  return terms;
}

Gatherer::Gatherer(const Lighting& lighting, const Effects& effects, const GatherOptions& options)
    : impl_(std::make_unique<Impl>(lighting, effects, options)) {}
Gatherer::~Gatherer() = default;

GatherResult Gatherer::gather(const GatherPoint& point, const HitLight& light, Counters& counters) {
  return impl_->gather(point, light, counters);
}

GradientTerms Gatherer::gradient(GradientMode mode) {
  Counters counters;
  return impl_->terms_of(mode, counters);
}

}  // namespace brume
