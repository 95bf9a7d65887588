#include "gather/guided_rays.h"

#include "gather/lighting.h"

namespace brume {
namespace {

constexpr int kSpokes = 4;       // Rays of a ring.
constexpr int kRings = 4;        // Around a lamp, half a cell wide each,
constexpr int kMostRings = 16;   // and of a beam, a cell wide each up to so many.
constexpr int kLampsInFull = 4;  // More share the rays of so many.
constexpr int kFewest = 4;       // A lamp that would get fewer is too faint to stand out.
constexpr int kFewestOfPanel = 8;

// Of all bright patches: more cells do not make what they bring less noisy.
int panel_rays(const DirectionCells& cells) { return std::max(32, cells.count() / 10); }

}  // namespace

// A line of sight that passes a lamp closely, on the side e, meets directions from it that lie in
// the half plane of e and the line: those that a cone holds, if any, begin where (axis.e)^2 +
// (axis.line)^2 = cosine^2.
GuidedRays::Lamp::Lamp(const Source& source, const Vec3d& origin, double cell_width)
    : reach(0.5 * kRings * cell_width), rings(kRings) {
  const Vec3d way = source.light->centre() - origin;
  around = Frame(way.normalized());
  brightness = source.light->importance() / way.length();
  const LightCone cone = source.light->cone();
  const double along = cone.axis.dot(around.n);
  const double across2 = 1 - along * along, wanted = cone.cosine * cone.cosine - along * along;
  if (cone.cosine > 0 && wanted > 0 && across2 > 0) {
    half_turn = std::acos(std::min(1.0, std::sqrt(wanted / across2)));
    const Vec3d local = around.to_local(cone.axis);
    around = around.turned(std::atan2(local.y, local.x));
    const Vec3d end = source.beam_end - origin;
    const double length = std::atan2(around.n.cross(end).length(), around.n.dot(end));
    reach = std::max(reach, length);
    rings = std::clamp(static_cast<int>(std::ceil(reach / cell_width)), kRings, kMostRings);
  }
  reach = std::min(reach, 0.5 * kPi);
  sine_of_reach = std::sin(reach);
}

Vec3d GuidedRays::Lamp::direction_at(double h, double turn) const {
  return around.to_world({std::sin(h) * std::cos(turn), std::sin(h) * std::sin(turn), std::cos(h)});
}

// Rays per solid angle: h and the turn around are uniform.
double GuidedRays::Lamp::density(const Vec3d& direction) const {
  const Vec3d local = around.to_local(direction);
  const double sine = std::sqrt(local.x * local.x + local.y * local.y);
  if (local.z <= 0 || sine > sine_of_reach) return 0;
  if (std::abs(std::atan2(local.y, local.x)) > half_turn) return 0;
  return count / (2 * half_turn * reach * std::max(sine, 1e-12));
}

GuidedRays::Panel::Panel(const BrightPatch& p, const Vec3d& origin, int rays)
    : patch(p),
      centre(p.centre - origin),
      plane(p.normal.dot(centre)),
      across_u(p.u / p.u.length2()),
      across_v(p.v / p.v.length2()),
      area(4 * p.u.cross(p.v).length()),
      count(rays) {}

Vec3d GuidedRays::Panel::direction_at(const Vec2d& u) const {
  return (centre + patch.u * (2 * u.x - 1) + patch.v * (2 * u.y - 1)).normalized();
}

// Rays per solid angle: points of the panel are uniform.
double GuidedRays::Panel::density(const Vec3d& direction) const {
  const double facing = patch.normal.dot(direction);
  if (!(facing < 0) || !(plane < 0)) return 0;
  const double t = plane / facing;
  const Vec3d at = direction * t - centre;
  if (!(std::abs(at.dot(across_u)) < 1) || !(std::abs(at.dot(across_v)) < 1)) return 0;
  return count * t * t / (-facing * area);
}

GuidedRays::GuidedRays(const World& world, const Effects& effects, const BrightPatches& patches)
    : patches_(patches) {
  if (!effects.scattering) return;
  for (const auto& light : world.lights()) {
    if (light->kind() != Light::Kind::Point && light->kind() != Light::Kind::Spot) continue;
    Source source{light.get(), light->centre()};
    const Ray axis{light->centre(), light->cone().axis};
    double length = world.tracer().intersect(axis).t;
    if (!world.medium().is_unbounded()) {
      const Box3d& box = world.medium().bounds();
      for (int a = 0; a < 3; ++a) {
        const double side = axis.direction[a] > 0 ? box.max[a] : box.min[a];
        if (axis.direction[a] != 0)
          length = std::min(length, std::max(0.0, (side - axis.origin[a]) / axis.direction[a]));
      }
    }
    if (length < kInfinity) source.beam_end = axis.at(length);
    sources_.push_back(source);
  }
}

void GuidedRays::draw(const Vec3d& origin, const Frame& frame, const DirectionCells& cells,
                      bool reflects, const RandomStream& random, Counters& counters) {
  rays_.clear();
  lamps_.clear();
  panels_.clear();
  draw_lamps(origin, frame, cells, random);
  if (reflects && !patches_.empty()) draw_patches(origin, frame, cells, random, counters);
  const bool is_sphere = cells.domain() == DirectionDomain::Sphere;
  for (GuidedRay& ray : rays_)
    ray.share = share(cells, ray.cell, ray.direction, is_sphere ? 1 : ray.direction.dot(frame.n));
}

// Unless it is below the horizon.
void GuidedRays::add(const Vec3d& direction, const Frame& frame, const DirectionCells& cells,
                     int target, int stratum) {
  const int cell = cells.cell_at(frame.to_local(direction));
  if (cell >= 0) rays_.push_back({direction, cell, 0, target, stratum});
}

void GuidedRays::draw_lamps(const Vec3d& origin, const Frame& frame, const DirectionCells& cells,
                            RandomStream random) {
  double all = 0;
  for (const Source& source : sources_) {
    if (source.light->centre() == origin) continue;
    lamps_.emplace_back(source, origin, 2 * cells.spread());
    all += lamps_.back().brightness;
  }
  for (Lamp& lamp : lamps_) {
    const double part = all > 0 ? std::min(1.0, kLampsInFull * lamp.brightness / all) : 0;
    lamp.count = static_cast<int>(std::lround(part * lamp.rings * kSpokes));
  }
  std::erase_if(lamps_, [](const Lamp& lamp) { return lamp.count < kFewest; });
  for (std::size_t l = 0; l < lamps_.size(); ++l) {
    const Lamp& lamp = lamps_[l];
    for (int i = 0; i < lamp.count; ++i) {
      const Vec2d u = random.uniform2();
      add(lamp.direction_at(lamp.reach * (i % lamp.rings + u.x) / lamp.rings,
                            lamp.half_turn * (2 * (i + u.y) / lamp.count - 1)),
          frame, cells, static_cast<int>(l), i);
    }
  }
}

void GuidedRays::draw_patches(const Vec3d& origin, const Frame& frame, const DirectionCells& cells,
                              const RandomStream& random, Counters& counters) {
  const bool is_sphere = cells.domain() == DirectionDomain::Sphere;
  const double width = 2 * cells.spread();
  const int rays = panel_rays(cells);
  RandomStream own(random_key(RandomStream(random).bits(), 0x7061746368ULL));
  patches_.visible_from(origin, is_sphere ? Vec3d(0.0) : frame.n, width * width,
                        2 * static_cast<std::size_t>(rays), RandomStream(own.bits()), counters,
                        visible_);
  const auto most = static_cast<std::size_t>(rays / kFewestOfPanel);
  if (visible_.size() > most) visible_.resize(most);
  int seen = 0;
  for (const BrightPatch& patch : visible_) seen += patch.seen;
  for (const BrightPatch& patch : visible_) {
    const int count = std::max(kFewestOfPanel, rays * patch.seen / seen);
    panels_.emplace_back(patch, origin, count);
    const int target = static_cast<int>(lamps_.size() + panels_.size()) - 1;
    for (int i = 0; i < count; ++i) {
      // Evenly along the longer edge.
      const Vec2d u = own.uniform2();
      const double even = (i + u.x) / count;
      const bool is_wide = patch.u.length2() >= patch.v.length2();
      add(panels_.back().direction_at(is_wide ? Vec2d(even, u.y) : Vec2d(u.y, even)), frame, cells,
          target, i);
    }
  }
}

double GuidedRays::share(const DirectionCells& cells, int c, const Vec3d& direction,
                         double weight) const {
  const double own = weight / cells.cell(c).measure;
  double sum = own;
  for (const Lamp& lamp : lamps_) sum += lamp.density(direction);
  for (const Panel& panel : panels_) sum += panel.density(direction);
  return own / sum;
}

double GuidedRays::variance_of_rings(const Lamp& lamp, std::span<const double> of_stratum) const {
  double sum = 0;
  int bends = 0;
  for (int i = lamp.rings; i + lamp.rings < lamp.count; ++i, ++bends) {
    const std::size_t at = static_cast<std::size_t>(i), step = static_cast<std::size_t>(lamp.rings);
    const double bend = of_stratum[at - step] - 2 * of_stratum[at] + of_stratum[at + step];
    sum += bend * bend / 6;
  }
  return bends > 0 ? sum * lamp.count / bends : 0;
}

double GuidedRays::variance(std::span<const double> values) const {
  double variance = 0;
  std::vector<double> of_stratum;
  std::size_t first = 0;
  for (std::size_t t = 0; t < lamps_.size() + panels_.size(); ++t) {
    const bool is_lamp = t < lamps_.size();
    const int count = is_lamp ? lamps_[t].count : panels_[t - lamps_.size()].count;
    // Those below the horizon bring nothing.
    of_stratum.assign(static_cast<std::size_t>(count), 0);
    for (; first < rays_.size() && rays_[first].target == static_cast<int>(t); ++first)
      of_stratum[static_cast<std::size_t>(rays_[first].stratum)] = values[first];
    if (is_lamp) {
      variance += variance_of_rings(lamps_[t], of_stratum);
      continue;
    }
    // They lie evenly along the patch, so what changes slowly along it is no noise.
    double squares = 0;
    for (int i = 1; i < count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      const double step = of_stratum[at] - of_stratum[at - 1];
      squares += step * step;
    }
    variance += 0.5 * squares * count / (count - 1);
  }
  return variance;
}

}  // namespace brume
