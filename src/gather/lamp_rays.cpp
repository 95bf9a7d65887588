#include "gather/lamp_rays.h"

#include "gather/lighting.h"

namespace brume {
namespace {

constexpr int kSpokes = 4;       // Rays of a ring.
constexpr int kRings = 4;        // Around a lamp, half a cell wide each,
constexpr int kMostRings = 16;   // and of a beam, a cell wide each up to so many.
constexpr int kLampsInFull = 4;  // More share the rays of so many.
constexpr int kFewest = 4;       // A lamp that would get fewer is too faint to stand out.

}  // namespace

// A line of sight that passes a lamp closely, on the side e, meets directions from it that lie in
// the half plane of e and the line: those that a cone holds, if any, begin where (axis.e)^2 +
// (axis.line)^2 = cosine^2.
LampRays::Lamp::Lamp(const Source& source, const Vec3d& origin, double cell_width)
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
}

Vec3d LampRays::Lamp::direction_at(double h, double turn) const {
  return around.to_world({std::sin(h) * std::cos(turn), std::sin(h) * std::sin(turn), std::cos(h)});
}

// Rays per solid angle: h and the turn around are uniform.
double LampRays::Lamp::density(const Vec3d& direction) const {
  const Vec3d local = around.to_local(direction);
  const double sine = std::hypot(local.x, local.y);
  if (local.z <= 0 || std::asin(std::min(1.0, sine)) > reach) return 0;
  if (std::abs(std::atan2(local.y, local.x)) > half_turn) return 0;
  return count / (2 * half_turn * reach * std::max(sine, 1e-12));
}

LampRays::LampRays(const World& world, const Effects& effects) {
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

void LampRays::draw(const Vec3d& origin, const Frame& frame, const DirectionCells& cells,
                    RandomStream random) {
  lamps_.clear();
  rays_.clear();
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
      const Vec3d w = lamp.direction_at(lamp.reach * (i % lamp.rings + u.x) / lamp.rings,
                                        lamp.half_turn * (2 * (i + u.y) / lamp.count - 1));
      const int cell = cells.cell_at(frame.to_local(w));
      if (cell >= 0) rays_.push_back({w, cell, 0, static_cast<int>(l), i});
    }
  }
  const bool is_sphere = cells.domain() == DirectionDomain::Sphere;
  for (LampRay& ray : rays_)
    ray.share = share(cells, ray.cell, ray.direction, is_sphere ? 1 : ray.direction.dot(frame.n));
}

double LampRays::share(const DirectionCells& cells, int c, const Vec3d& direction,
                       double weight) const {
  const double own = weight / cells.cell(c).measure;
  double sum = own;
  for (const Lamp& lamp : lamps_) sum += lamp.density(direction);
  return own / sum;
}

double LampRays::variance(std::span<const double> values) const {
  double variance = 0;
  std::vector<double> of_stratum;
  for (std::size_t l = 0, first = 0; l < lamps_.size(); ++l) {
    const Lamp& lamp = lamps_[l];
    // Those below the horizon bring nothing.
    of_stratum.assign(static_cast<std::size_t>(lamp.count), 0);
    for (; first < rays_.size() && rays_[first].lamp == static_cast<int>(l); ++first)
      of_stratum[static_cast<std::size_t>(rays_[first].stratum)] = values[first];
    double sum = 0;
    int bends = 0;
    for (int i = lamp.rings; i + lamp.rings < lamp.count; ++i, ++bends) {
      const std::size_t at = static_cast<std::size_t>(i),
                        step = static_cast<std::size_t>(lamp.rings);
      const double bend = of_stratum[at - step] - 2 * of_stratum[at] + of_stratum[at + step];
      sum += bend * bend / 6;
    }
    if (bends > 0) variance += sum * lamp.count / bends;
  }
  return variance;
}

}  // namespace brume
