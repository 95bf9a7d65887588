#include "gather/cell_gather.h"

namespace brume {
namespace {

// Shells grow from kNearness / (1 + kNearness) of the farthest one's thickness where the point lies
// inside the medium; infinite would be even ones.
constexpr double kNearness = 0.3;
constexpr int kSourceSamples =
    8;  // Of each area light, for the source term at the receiver itself.

// Shells of a ray that ask for light that has scattered before: a few tell, it changes slowly
// (docs/decisions/0012).
constexpr int kMostAsked = 8;

Vec3d perpendicular(const Vec3d& v, const Vec3d& w) { return v - w * v.dot(w); }
RgbGradient perpendicular(const RgbGradient& g, const Vec3d& w) {
  return {perpendicular(g.r, w), perpendicular(g.g, w), perpendicular(g.b, w)};
}

}  // namespace

CellGather::CellGather(const Lighting& lighting, const Effects& effects,
                       const GatherOptions& options, DirectionDomain domain)
    : lighting_(lighting),
      world_(lighting.world()),
      effects_(effects),
      options_(options),
      exact_(world_.medium(), march_options()),
      cones_(world_.medium(), options.step_voxels),
      surfaces_(lighting, is_full()),
      medium_(lighting, effects, is_full()),
      guided_(world_, effects, lighting.bright_patches()),
      cells_(options.cell_count(), domain),
      noise_(cells_) {
  const auto& volumes = world_.medium().volumes();
  for (std::size_t v = 0; v < volumes.size(); ++v)
    if (!volumes[v].is_homogeneous()) bends_.push_back({static_cast<int>(v), {}});
}

MarchOptions CellGather::march_options() const {
  MarchOptions m = lighting_.march();
  if (options_.step_voxels > 0) m.step_voxels = options_.step_voxels;
  return m;
}

void CellGather::gather(const Vec3d& origin, const Frame& base, std::uint64_t key,
                        const HitLight& light, Counters& counters) {
  key_ = key;
  origin_ = origin;
  scattered_ = light.scattered.get();
  medium_.use_scattered(scattered_, kMostAsked);
  start_over();
  RandomStream turn = stream(-1, 0);
  frame_ = base.turned(2 * kPi * turn.uniform());
  const Vec2d shift = turn.uniform2();
  const int n = cells_.count();
  cell_.assign(n, Cell());
  light_.assign(n, CellLight());
  own_.assign(n, 0);
  strata_.strata.clear();
  strata_.points.clear();
  strata_.spread = cells_.spread();
  for (int c = 0; c < n; ++c) cell_[c].w = frame_.to_world(cells_.direction(c, shift)).normalized();
  guided_.draw(origin_, frame_, cells_, light.reflect, stream(-2, 0), counters);
  from_guided_.assign(guided_.rays().size(), 0);
  trace(light, counters);
  find_walls();
  boundaries_.clear();
  if (effects_.medium) choose_shells();
  sigma_here_ = effects_.medium ? world_.medium().sigma_t_at(origin_) : RgbD();
  const int at_once = marches_exactly() ? 1 : ConeMarcher::kRays;
  for (int first = 0; first < slot_count(); first += at_once)
    add_rays(first, std::min(at_once, slot_count() - first), counters);
}

void CellGather::start_over() {
  medium_.use_lamp_samples(options_.lamp_samples, is_full(), stream(-1, 3));
}

// Pass 1: what each ray sees, and what surfaces send along it.
void CellGather::trace(const HitLight& light, Counters& counters) {
  const int n = cells_.count();
  rays_.clear();
  for (int c = 0; c < n; ++c) rays_.push_back(ray_of(cell_[c]));
  for (const GuidedRay& ray : guided_.rays()) rays_.push_back({origin_, ray.direction});
  hits_.resize(rays_.size());
  world_.tracer().intersect(rays_, hits_);
  counters.rays += rays_.size();

  surfaces_.begin(hits_.size(), stream(-2, 1));
  for (std::size_t i = 0; i < hits_.size(); ++i) {
    const Hit& hit = hits_[i];
    if (!hit.is_hit()) continue;
    const Vec3d& w = rays_[i].direction;
    double width = cells_.spread();
    if (i < static_cast<std::size_t>(n)) {
      cell_[i].s = hit.t;
      const double height = hit.normal.dot(w) * hit.t;
      if (height != 0) cell_[i].q = hit.normal / height;
    } else {
      // As wide as the solid angle that the ray stands for.
      width *= std::sqrt(guided_.rays()[i - static_cast<std::size_t>(n)].share);
    }
    surfaces_.add(i, hit, w, width * hit.t, light, counters);
  }
  surfaces_.finish(counters);
}

// 1/r at a wall between two cells: the nearer of their hit planes, extended to the wall's direction
// (gradients.md 4), and no nearer than half the nearer hit.
double CellGather::inverse_wall_distance(const Cell& a, const Cell& b, const Vec3d& wall) {
  const double nearest = std::min(a.s, b.s);
  if (!(nearest < kInfinity)) return 0;
  const double inverse = std::max(a.q.dot(wall), b.q.dot(wall));
  return std::clamp(inverse, 0.0, 2 / nearest);
}

void CellGather::find_walls() {
  inverse_r_.assign(cells_.side_count(), 0);
  phi_.assign(cells_.side_count(), RgbD());
  if (options_.gradient == GradientMode::None) return;
  for (const CellWall& wall : cells_.walls())
    inverse_r_[wall.low_side] = inverse_r_[wall.high_side] =
        inverse_wall_distance(cell_[wall.low], cell_[wall.high], frame_.to_world(wall.middle));
}

// Boundaries common to all cells (gradients.md 5), over the part of the medium that rays can reach.
void CellGather::choose_shells() {
  boundaries_.clear();
  double farthest = 0;
  for (const Cell& c : cell_) farthest = std::max(farthest, c.s);
  const Box3d& box = world_.medium().bounds();
  double begin = 0, end = farthest;
  if (!world_.medium().is_unbounded()) {
    Vec3d nearest = origin_, far = origin_;
    for (int a = 0; a < 3; ++a) {
      nearest[a] = std::clamp(origin_[a], box.min[a], box.max[a]);
      far[a] = origin_[a] - box.min[a] > box.max[a] - origin_[a] ? box.min[a] : box.max[a];
    }
    begin = (nearest - origin_).length();
    end = std::min(end, (far - origin_).length());
  } else if (!(end < kInfinity)) {
    // Nothing ends the medium: what lies past 50 mean free paths does not arrive.
    const double sigma = max_component(world_.medium().sigma_t_at(origin_));
    end = sigma > 0 ? 50 / sigma : world_.diagonal();
  }
  if (!(begin < end)) return;
  int count = options_.shells;
  if (count == 0) {
    const double voxels = (end - begin) / world_.medium().voxel_size();
    count = std::clamp(static_cast<int>(voxels / 3), 24, GatherOptions::kMaxAutomaticShells);
  }
  // Even steps of log(t + t0): near ones are thin, because an edge of a light shaft that lies
  // inside one is taken for its centre, and that matters as 1/t.
  const double t0 = kNearness * (end - begin), growth = std::log((end + t0) / (begin + t0));
  for (int i = 0; i < count; ++i)
    boundaries_.push_back(std::max(begin, (begin + t0) * std::exp(growth * i / count) - t0));
  boundaries_.push_back(end);
  jitter_.resize(count);
  shell_shift_.resize(count);
  RandomStream random = stream(-1, 2);
  for (float& shift : shell_shift_) shift = static_cast<float>(random.uniform());
  step_shift_ = random.uniform();
  if (!marches_exactly())
    cones_.begin(origin_, boundaries_, options_.footprint * 2 * cells_.spread(), shell_shift_);
}

// Each shell by itself evenly, rays one after the other a golden section apart, so that few of them
// see much of a shell.
ShellJitter CellGather::jitter(int slot) const {
  const double turn = slot * (std::numbers::phi - 1);
  return {shell_shift_, turn - std::floor(turn)};
}

// Places within steps are as even over rays as those within shells, by another irrational.
void CellGather::march(int first, int count, bool gradients, Counters& counters) {
  MarchCounters march;
  marched_.clear();
  if (marches_exactly()) {
    const ShellJitter places = jitter(first);
    for (std::size_t i = 0; i < jitter_.size(); ++i) jitter_[i] = places.at(static_cast<int>(i));
    exact_.march(rays_[static_cast<std::size_t>(first)], boundaries_, end_of(first), jitter_,
                 gradients, march);
    marched_.push_back(exact_.view());
  } else {
    cone_rays_.clear();
    for (int slot = first; slot < first + count; ++slot) {
      const double place = step_shift_ + slot * (std::numbers::sqrt2 - 1);
      cone_rays_.push_back({rays_[static_cast<std::size_t>(slot)].direction, end_of(slot),
                            static_cast<float>(place - std::floor(place)),
                            static_cast<float>(jitter(slot).turn)});
    }
    cones_.march(cone_rays_, gradients, march);
    for (int i = 0; i < count; ++i) marched_.push_back(cones_.ray(i));
  }
  counters.march_rays += march.rays;
  counters.segments += march.segments;
}

// Pass 2 for some rays: marches them, and adds what their media and surfaces send.
void CellGather::add_rays(int first, int count, Counters& counters) {
  const bool has_medium = !boundaries_.empty();
  const bool has_light = has_medium && (has_source() || effects_.emission);
  if (has_medium) march(first, count, is_full() && effects_.heterogeneous, counters);
  if (has_light) {
    medium_.begin();
    for (int i = 0; i < count; ++i) {
      RandomStream random = stream(first + i, 2);
      medium_.add(marched_[static_cast<std::size_t>(i)], rays_[static_cast<std::size_t>(first + i)],
                  boundaries_, end_of(first + i), jitter(first + i), random);
    }
    medium_.finish(counters);
  }
  const int n = cells_.count();
  for (int i = 0; i < count; ++i) {
    const int slot = first + i;
    const bool is_guided = slot >= n;
    const std::size_t guided = static_cast<std::size_t>(slot - n);
    const int c = is_guided ? guided_.rays()[guided].cell : slot;
    const MarchedShells* marched = has_medium ? &marched_[static_cast<std::size_t>(i)] : nullptr;
    if (marched && !is_guided && options_.medium_points >= 0) keep_medium_points(c, *marched);
    const double share = share_of(slot);
    const RgbD transmittance = marched ? marched->transmittance() : RgbD(1);
    double added = add_surface(c, slot, marched, transmittance * share);
    if (has_light) added += add_medium(c, slot, *marched, medium_.light(i), share);
    if (is_guided)
      from_guided_[guided] = cells_.cell(c).measure * added;
    else
      own_[c] = added;
  }
}

// What counts of a ray's light in its cell's mean.
double CellGather::share_of(int slot) const {
  const int n = cells_.count();
  if (slot >= n) return guided_.rays()[static_cast<std::size_t>(slot - n)].share;
  if (guided_.rays().empty()) return 1;
  const double weight =
      cells_.domain() == DirectionDomain::Sphere ? 1 : cell_[slot].w.dot(frame_.n);
  return guided_.share(cells_, slot, cell_[slot].w, weight);
}

double CellGather::add_medium(int c, int slot, const MarchedShells& marched,
                              std::span<const MediumLight> sent, double share) {
  const Vec3d& w = rays_[static_cast<std::size_t>(slot)].direction;
  const double end = end_of(slot);
  const DirectionCell& around = cells_.cell(c);
  CellLight& light = light_[c];
  RgbD all;
  RgbGradient directional;
  for (const MediumLight& part : sent) {
    if (is_black(part.light)) continue;
    const RgbD f = part.light * share;
    const double inverse_t =
        2 / (boundaries_[part.shell] + std::min(boundaries_[part.shell + 1], end));
    all += f;
    light.over_distance += luminance(f) * inverse_t;
    if (!is_full()) continue;
    // Phi of gradients.md 3: F / min(t, r).
    for (int side = around.first_side; side < around.end_side; ++side)
      phi_[side] += f * std::max(inverse_t, inverse_r_[side]);
    for (Bend& bend : bends_)
      bend.add(f * 0.5, bend_integral(marched, bend.volume, part.shell, inverse_t) +
                            bend_integral(marched, bend.volume, part.shell + 1, inverse_t));
    if (effects_.anisotropic) directional += part.directional * (inverse_t * share);
  }
  light.media += all;
  if (!is_full()) return luminance(all);
  for (Bend& bend : bends_) {
    light.grad_sigma -= perpendicular(bend.in_world(world_.medium().volumes()[bend.volume]), w);
    bend.sum = {};
  }
  if (effects_.anisotropic) light.directional += perpendicular(directional, w);
  return luminance(all);
}

// I0 - I1/t of a volume's density up to where `shell` begins, for a ray that ends at t.
Vec3d CellGather::bend_integral(const MarchedShells& marched, int volume, int shell,
                                double inverse_t) {
  return marched.grad_integral(volume, shell) - marched.grad_moment(volume, shell) * inverse_t;
}

// What the surface at the end of ray `slot` sends, dimmed, as part of a cell's light. Returns its
// luminance.
double CellGather::add_surface(int c, int slot, const MarchedShells* marched, const RgbD& dimming) {
  const std::size_t at = static_cast<std::size_t>(slot);
  const Vec3d& w = rays_[at].direction;
  if (options_.medium_points >= 0) keep_stratum(c, slot, dimming);
  const RgbD sent = surfaces_.radiance(at) * dimming;
  if (is_black(sent)) return 0;
  CellLight& light = light_[c];
  light.surface += sent;
  light.emitted += surfaces_.emitted(at) * dimming;
  const double inverse_s = 1 / hits_[at].t;
  light.over_distance += luminance(sent) * inverse_s;
  if (!is_full()) return luminance(sent);
  const double within = slot == c ? 0 : inverse_distance_within(slot);
  const DirectionCell& around = cells_.cell(c);
  for (int side = around.first_side; side < around.end_side; ++side)
    phi_[side] += sent * (slot == c ? inverse_r_[side] : within);
  for (Bend& bend : bends_) {
    if (!marched) break;
    bend.add(sent, bend_integral(*marched, bend.volume, marched->shell_count(), inverse_s));
    light.grad_sigma -= perpendicular(bend.in_world(world_.medium().volumes()[bend.volume]), w);
    bend.sum = {};
  }
  if (!surfaces_.has_derivatives()) return luminance(sent);
  RgbGradient d = surfaces_.direction_derivative(at);
  for (int ch = 0; ch < 3; ++ch) d[ch] *= dimming[ch] * inverse_s;
  light.directional -= perpendicular(d, w);
  return luminance(sent);
}

// 1/r of the edges of what a guided ray found: they lie within its cell, at the nearest that the
// rays of its target found there, be it bright or in front.
double CellGather::inverse_distance_within(int slot) const {
  const auto rays = guided_.rays();
  const std::size_t first = static_cast<std::size_t>(cells_.count());
  const GuidedRay& ray = rays[static_cast<std::size_t>(slot) - first];
  double nearest = kInfinity;
  for (std::size_t i = 0; i < rays.size(); ++i)
    if (rays[i].cell == ray.cell && rays[i].target == ray.target)
      nearest = std::min(nearest, double(hits_[first + i].t));
  return 1 / nearest;
}

// After the points of a cell's own ray; guided rays have none, since what scattered before is
// nowhere much brighter than elsewhere.
void CellGather::keep_stratum(int c, int slot, const RgbD& dimming) {
  const std::size_t points_before = strata_.strata.empty() ? 0 : strata_.strata.back().points_end;
  const Hit& hit = hits_[static_cast<std::size_t>(slot)];
  const Vec3d& w = rays_[static_cast<std::size_t>(slot)].direction;
  RgbD reflectance;
  if (hit.is_hit()) reflectance = dimming * diffuse_reflectance(world_.material(hit)) * kInvPi;
  if (is_black(reflectance) && strata_.points.size() == points_before) return;
  Stratum s{};
  s.measure = static_cast<float>(cells_.cell(c).measure);
  s.points_end = static_cast<std::uint32_t>(strata_.points.size());
  const Vec3d normal = hit.is_hit() ? reflecting_normal(hit, w) : Vec3d(0.0);
  for (int a = 0; a < 3; ++a) {
    s.direction[a] = static_cast<float>(w[a]);
    s.normal[a] = static_cast<float>(normal[a]);
    s.reflectance[a] = static_cast<float>(reflectance[a]);
  }
  s.distance = hit.is_hit() ? static_cast<float>(hit.t) : 0.0f;
  strata_.strata.push_back(s);
}

// A few points, evenly through the running sum of what the stretches scatter. Their weights sum to
// all of it in each channel, so that nothing is lost or gained by choosing.
void CellGather::keep_medium_points(int c, const MarchedShells& marched) {
  if (options_.medium_points == 0 || !effects_.multiple_scattering) return;
  medium_.stretches(marched, ray_of(cell_[c]), stretches_);
  RgbD all;
  for (const MediumStretch& s : stretches_) all += s.weight;
  const double sum = mean_component(all);
  if (!(sum > 0)) return;
  // One stands for little, more where much is scattered.
  const int count = std::clamp(static_cast<int>(std::ceil(4 * sum * options_.medium_points)), 1,
                               options_.medium_points);
  const std::size_t first = strata_.points.size();
  RandomStream random = stream(c, 3);
  const double spacing = sum / count;
  double next = random.uniform() * spacing, running = 0;
  RgbD chosen;
  for (const MediumStretch& s : stretches_) {
    const double share = mean_component(s.weight);
    running += share;
    int times = 0;
    for (; next < running; next += spacing) ++times;
    if (times == 0) continue;
    const RgbD weight = s.weight * (times * spacing / share);
    chosen += weight;
    MediumPoint point{static_cast<float>(s.distance), static_cast<std::uint32_t>(s.volume), {}};
    for (int ch = 0; ch < 3; ++ch) point.weight[ch] = static_cast<float>(weight[ch]);
    strata_.points.push_back(point);
  }
  for (std::size_t i = first; i < strata_.points.size(); ++i)
    for (int ch = 0; ch < 3; ++ch)
      if (chosen[ch] > 0) strata_.points[i].weight[ch] *= static_cast<float>(all[ch] / chosen[ch]);
}

double CellGather::error() const {
  std::vector<Vec3d> directions;
  for (const Cell& c : cell_) directions.push_back(c.w);
  return std::sqrt(noise_.variance(cells_, directions, own_) + guided_.variance(from_guided_));
}

void CellGather::look_here(Counters& counters) {
  RandomStream random = stream(-1, 1);
  here_ = medium_.source_at(origin_, kSourceSamples, random, counters);
}

void CellGather::use_surface_distances() {
  for (int c = 0; c < cells_.count(); ++c) {
    const DirectionCell& around = cells_.cell(c);
    for (int side = around.first_side; side < around.end_side; ++side)
      phi_[side] = light_[c].total() * inverse_r_[side];
  }
}

RgbGradient CellGather::moving_medium(int c, Counters& counters) {
  const double h = 0.25 * std::min(world_.medium().voxel_size(), 4e-3 * world_.diagonal());
  const auto& volumes = world_.medium().volumes();
  const Ray ray = ray_of(cell_[c]);
  RandomStream random = stream(c, 2);
  march(c, 1, true, counters);
  const MarchedShells& marched = marched_.front();
  const ShellJitter places = jitter(c);
  medium_.begin();
  medium_.add(marched, ray, boundaries_, cell_[c].s, places, random);
  medium_.finish(counters);
  const int n = marched.shell_count();
  const auto i0 = [&](int shell) {
    RgbGradient b;
    for (const Bend& bend : bends_)
      b += Bend{bend.volume, outer(RgbD(1), marched.grad_integral(bend.volume, shell))}.in_world(
          volumes[bend.volume]);
    return b;
  };
  RgbGradient d;
  for (const MediumLight& part : medium_.light(0)) {
    const RgbGradient bend = (i0(part.shell) + i0(part.shell + 1)) * 0.5;
    for (int ch = 0; ch < 3; ++ch) d[ch] -= bend[ch] * part.light[ch];
  }
  for (int i = 0; i < n; ++i) {
    const double a = boundaries_[i], b = std::min(boundaries_[i + 1], cell_[c].s);
    const Vec3d p = ray.at(a + places.at(i) * (b - a));
    const RgbD weight = marched.transmittance(i) * (b - a);
    const auto add_gradient = [&](auto&& q) {
      for (int axis = 0; axis < 3; ++axis) {
        Vec3d e(0.0);
        e[axis] = h;
        const RgbD slope = (q(p + e) - q(p - e)) / (2 * h) * weight;
        for (int ch = 0; ch < 3; ++ch) d[ch][axis] += slope[ch];
      }
    };
    if (effects_.emission) add_gradient([&](const Vec3d& y) { return medium_.emission_at(y); });
    if (scattered_)
      add_gradient([&](const Vec3d& y) { return medium_.scattered_again(y, cell_[c].w); });
    if (!effects_.scattering) continue;
    for (std::size_t l = 0; l < world_.lights().size(); ++l) {
      const Vec2d u = random.uniform2();
      if (world_.tracer().is_occluded(shadow_ray(p, world_.lights()[l]->sample(p, u)))) continue;
      add_gradient([&](const Vec3d& y) {
        return medium_.unshadowed(y, cell_[c].w, static_cast<int>(l), u, counters);
      });
    }
  }
  const RgbD from_surface = surfaces_.radiance(c) * marched.transmittance();
  const RgbGradient bend = i0(n);
  for (int ch = 0; ch < 3; ++ch) d[ch] -= bend[ch] * from_surface[ch];
  return d;
}

}  // namespace brume
