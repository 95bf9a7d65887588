#include "gather/bright_patches.h"

#include <algorithm>
#include <array>

#include "core/lattice.h"
#include "gather/surface_light.h"

namespace brume {
namespace {

constexpr int kRays = 2048;        // Of all lamps.
constexpr int kNeighbours = 12;    // A place reaches to as many other rays' ends.
constexpr double kBright = 8;      // Times what the lit surfaces receive in the mean.
constexpr int kTried = 256;        // From each receiver.
constexpr int kRefinements = 2;    // Of each small rectangle that holds what is seen of a patch.
constexpr double kWider = 2;       // Times a patch, where more of it is looked for:
constexpr double kAsBright = 0.1;  // Times as bright as the brightest point, at least.
constexpr std::size_t kFewestPoints = 3;  // That tell a rectangle.
constexpr std::size_t kMostRefined = 3;   // Patches, the most seen.
constexpr double kCloseBy = 2;    // Radii apart that places may be and still be of one patch.
constexpr double kSameWay = 0.8;  // Cosine between their normals, at least.

}  // namespace

// Where lamps' rays land, by power.
std::vector<BrightPatches::Place> BrightPatches::landings(const World& world) {
  std::vector<double> up_to;
  double power = 0;
  for (const auto& light : world.lights())
    up_to.push_back(power += light->emit({0.5, 0.5}, {0.5, 0.5}) ? light->importance() : 0);
  std::vector<Place> found;
  if (!(power > 0) || !std::isfinite(power)) return found;
  for (int i = 0; i < kRays; ++i) {
    const auto chosen = std::upper_bound(up_to.begin(), up_to.end(), power * (i + 0.5) / kRays);
    const auto l = std::min<std::ptrdiff_t>(chosen - up_to.begin(), std::ssize(up_to) - 1);
    RandomStream random(random_key(0x70617463686573ULL, i));
    const Vec2d place = random.uniform2(), way = random.uniform2();
    std::optional<Ray> ray = world.lights()[static_cast<std::size_t>(l)]->emit(place, way);
    if (!ray) continue;
    ray->origin += ray->direction * world.tracer().offset_at(ray->origin);
    const Hit hit = world.tracer().intersect(*ray);
    if (hit.is_hit() && world.material(hit).reflects())
      found.push_back({hit.position, reflecting_normal(hit, ray->direction), 0});
  }
  return found;
}

// To the farthest of so many neighbours that face the same way.
void BrightPatches::find_radii(std::vector<Place>& places) {
  for (Place& p : places) {
    std::array<double, kNeighbours + 1> nearest;  // Squared, with itself, ascending.
    nearest.fill(kInfinity);
    for (const Place& other : places) {
      const double d2 = (other.position - p.position).length2();
      if (!(d2 < nearest.back()) || p.normal.dot(other.normal) < kSameWay) continue;
      nearest.back() = d2;
      for (std::size_t i = nearest.size() - 1; i > 0 && nearest[i] < nearest[i - 1]; --i)
        std::swap(nearest[i], nearest[i - 1]);
    }
    p.radius = std::sqrt(nearest.back());
  }
}

BrightPatches::BrightPatches(const World& world) : world_(world) {
  std::vector<Place> all = landings(world);
  find_radii(all);
  std::erase_if(all, [](const Place& p) { return !(p.radius > 0 && p.radius < kInfinity); });
  double area = 0;
  for (const Place& p : all) area += p.radius * p.radius;
  for (const Place& p : all)
    if (p.radius * p.radius * kBright * double(all.size()) < area) places_.push_back(p);
}

// Along the axes of their spread, and a radius wider.
BrightPatch BrightPatches::patch_of(std::span<const Place* const> places) {
  Vec3d normal(0.0), middle(0.0);
  double radius = 0;
  for (const Place* p : places) {
    normal += p->normal;
    middle += p->position / double(places.size());
    radius += p->radius / double(places.size());
  }
  const Frame frame(normal.normalized());
  double xx = 0, xy = 0, yy = 0;
  for (const Place* p : places) {
    const Vec3d at = frame.to_local(p->position - middle);
    xx += at.x * at.x, xy += at.x * at.y, yy += at.y * at.y;
  }
  const Frame along = frame.turned(0.5 * std::atan2(2 * xy, xx - yy));
  Vec2d low(kInfinity, kInfinity), high(-kInfinity, -kInfinity);
  for (const Place* p : places) {
    const Vec3d at = along.to_local(p->position - middle);
    low = {std::min(low.x, at.x), std::min(low.y, at.y)};
    high = {std::max(high.x, at.x), std::max(high.y, at.y)};
  }
  // Beyond the outermost found lies as much as between two, in the mean.
  const double gaps = double(places.size()) - 1;
  const auto half = [&](double extent) {
    return 0.5 * extent + (gaps > 0 ? std::max(radius, extent / gaps) : radius);
  };
  BrightPatch patch;
  patch.centre = middle + along.u * (0.5 * (low.x + high.x)) + along.v * (0.5 * (low.y + high.y));
  patch.normal = frame.n;
  patch.u = along.u * half(high.x - low.x);
  patch.v = along.v * half(high.y - low.y);
  patch.seen = static_cast<int>(places.size());
  return patch;
}

void BrightPatches::visible_from(const Vec3d& origin, const Vec3d& normal, double solid_angle,
                                 std::size_t pilots, RandomStream random, Counters& counters,
                                 std::vector<BrightPatch>& visible) const {
  visible.clear();
  std::vector<double> up_to;
  double sum = 0;
  const bool is_all_around = normal.length2() == 0;
  for (const Place& p : places_) {
    const Vec3d to = p.position - origin;
    const double d2 = to.length2(), facing = -p.normal.dot(to), r2 = p.radius * p.radius;
    const double receiving = is_all_around ? std::sqrt(d2) : normal.dot(to);
    // facing / d is the cosine there, pi r^2 facing / d^3 the solid angle.
    const bool counts =
        facing > 0 && receiving > 0 && kPi * r2 * facing < solid_angle * d2 * std::sqrt(d2);
    if (counts) sum += facing * receiving / (d2 * (d2 + r2));
    up_to.push_back(sum);
  }
  if (!(sum > 0)) return;
  std::vector<const Place*> tried;
  std::vector<ShadowRay> rays;
  const double shift = random.uniform();
  for (int i = 0; i < kTried; ++i) {
    const auto found = std::upper_bound(up_to.begin(), up_to.end(), sum * (i + shift) / kTried);
    if (found == up_to.end()) continue;
    const Place* place = &places_[static_cast<std::size_t>(found - up_to.begin())];
    if (!tried.empty() && tried.back() == place) continue;
    tried.push_back(place);
    const Vec3d to = place->position - origin;
    const double d = to.length();
    rays.push_back({origin, to / d, d * (1 - 1e-3)});
  }
  std::vector<std::uint8_t> occluded(rays.size());
  world_.tracer().is_occluded(rays, occluded);
  counters.shadow_rays += rays.size();

  // Those that are seen, each group with all that are near any of it.
  std::vector<const Place*> open, group;
  for (std::size_t i = 0; i < tried.size(); ++i)
    if (!occluded[i]) open.push_back(tried[i]);
  while (!open.empty()) {
    group = {open.back()};
    open.pop_back();
    for (std::size_t i = 0; i < group.size(); ++i) {
      const Place* member = group[i];
      const auto is_far = [&](const Place* p) {
        const double reach = kCloseBy * (p->radius + member->radius);
        return (p->position - member->position).length2() > reach * reach ||
               p->normal.dot(group[0]->normal) < kSameWay;
      };
      const auto near = std::stable_partition(open.begin(), open.end(), is_far);
      group.insert(group.end(), near, open.end());
      open.erase(near, open.end());
    }
    visible.push_back(patch_of(group));
  }
  std::stable_sort(visible.begin(), visible.end(),
                   [](const BrightPatch& a, const BrightPatch& b) { return a.seen > b.seen; });
  const std::size_t coarse = std::min(visible.size(), kMostRefined);
  for (std::size_t i = 0; i < coarse; ++i)
    refine(BrightPatch(visible[i]), pilots, origin, random, counters, visible);
}

// Past an edge, as through a slit, much less of a patch may be seen than lies between the places
// that are: adds the smaller rectangles that hold what is.
void BrightPatches::refine(const BrightPatch& coarse, std::size_t pilots, const Vec3d& origin,
                           RandomStream& random, Counters& counters,
                           std::vector<BrightPatch>& patches) const {
  std::vector<Place> points;
  bright_points(coarse, 1, pilots, origin, random, counters, points);
  if (points.size() < kFewestPoints || points.size() > pilots / 4) return;
  std::vector<const Place*> all;
  for (const Place& p : points) all.push_back(&p);
  const int seen = static_cast<int>(points.size());
  std::vector<BrightPatch> parts;
  split(all, 2, parts);
  for (BrightPatch& part : parts) {
    const int share = part.seen;
    for (int pass = 0; pass < kRefinements; ++pass) {
      bright_points(part, kWider, pilots / 2, origin, random, counters, points);
      if (points.size() < kFewestPoints) break;
      all.clear();
      for (const Place& p : points) all.push_back(&p);
      part = patch_of(all);
    }
    part.seen = std::max(1, coarse.seen * share / seen);
    patches.push_back(part);
  }
}

// Of points all over a patch, `wider` times as wide, those that are seen and not much darker than
// the brightest is.
void BrightPatches::bright_points(const BrightPatch& patch, double wider, std::size_t pilots,
                                  const Vec3d& origin, RandomStream& random, Counters& counters,
                                  std::vector<Place>& points) const {
  std::vector<ShadowRay> rays(pilots);
  std::vector<std::uint8_t> occluded(pilots);
  std::vector<double> brightness(pilots, 0.0);
  const Vec2d shift = random.uniform2();
  points.resize(pilots);
  for (std::size_t i = 0; i < pilots; ++i) {
    const Vec2d u = lattice_point(double(i), shift);
    Place& p = points[i];
    p = {patch.centre + patch.u * (wider * (2 * u.x - 1)) + patch.v * (wider * (2 * u.y - 1)),
         patch.normal, 2 * wider * patch.v.length() / double(pilots)};
    const Vec3d to = p.position - origin;
    const double d = to.length();
    rays[i] = {origin, to / d, d * (1 - 1e-3)};
  }
  world_.tracer().is_occluded(rays, occluded);
  counters.shadow_rays += rays.size();
  for (std::size_t i = 0; i < pilots; ++i) {
    if (occluded[i]) continue;
    const Vec2d of_light = lattice_point(double(i), {shift.y, shift.x});
    for (const auto& light : world_.lights()) {
      const LightSample s = light->sample(points[i].position, of_light);
      brightness[i] += luminance(s.weight) * std::max(0.0, patch.normal.dot(s.direction));
    }
  }
  const double least = kAsBright * *std::max_element(brightness.begin(), brightness.end());
  std::size_t kept = 0;
  for (std::size_t i = 0; i < pilots; ++i)
    if (!occluded[i] && brightness[i] >= least) points[kept++] = points[i];
  points.resize(kept);
}

// One rectangle around points, or several where they hold much less, as around an L.
void BrightPatches::split(std::span<const Place*> places, int depth,
                          std::vector<BrightPatch>& patches) {
  const BrightPatch whole = patch_of(places);
  const std::size_t n = places.size();
  double least = 0.5 * whole.area();
  std::size_t best = 0;
  bool best_along_u = true;
  const auto sort_along = [&](const Vec3d& axis) {
    std::stable_sort(places.begin(), places.end(), [&](const Place* a, const Place* b) {
      return a->position.dot(axis) < b->position.dot(axis);
    });
  };
  if (depth > 0 && n >= 2 * kFewestPoints) {
    for (const bool along_u : {true, false}) {
      sort_along(along_u ? whole.u : whole.v);
      for (std::size_t k = kFewestPoints; k + kFewestPoints <= n; k += 1 + n / 16) {
        const double area = patch_of(places.first(k)).area() + patch_of(places.subspan(k)).area();
        if (area >= least) continue;
        least = area;
        best = k;
        best_along_u = along_u;
      }
    }
  }
  if (best == 0) {
    patches.push_back(whole);
    return;
  }
  sort_along(best_along_u ? whole.u : whole.v);
  split(places.first(best), depth - 1, patches);
  split(places.subspan(best), depth - 1, patches);
}

}  // namespace brume
