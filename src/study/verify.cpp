#include "study/verify.h"

#include <algorithm>
#include <chrono>

#include "core/parallel.h"
#include "core/random.h"
#include "render/irradiance_paths.h"

namespace brume {
namespace {

// A point of the same surface as `record`, inside its radius; nothing where the surface ends there.
std::optional<Hit> near_record(const World& world, const Vec3d& position, const Vec3d& normal,
                               double radius, RandomStream& random) {
  const Frame frame(normal);
  const Vec2d u = random.uniform2();
  const double r = 0.9 * radius * std::sqrt(u.x);
  const double lift = 0.25 * radius + 4 * world.tracer().offset_at(position);
  const double phi = 2 * kPi * u.y;
  const Vec3d above =
      position + frame.u * (r * std::cos(phi)) + frame.v * (r * std::sin(phi)) + normal * lift;
  const Hit hit = world.tracer().intersect({above, -normal}, 2 * lift);
  if (!hit.is_hit() || std::abs(hit.normal.dot(normal)) < 0.99) return std::nullopt;
  return hit;
}

}  // namespace

double VerifyPoint::relative_error() const {
  return (cached - reference) / std::max(reference, floor);
}

Verification verify_cache(const Lighting& lighting, const BakeSettings& settings,
                          const IrradianceCache& cache, const VerifyOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const World& world = lighting.world();
  std::vector<const SurfaceRecord*> top;
  for (const SurfaceRecord& r : cache.records())
    if (r.layer() == kTopLayer) top.push_back(&r);
  Verification v;
  if (top.empty()) return v;

  struct Outcome {
    VerifyPoint point;
    TracedIrradiance truth;
    bool on_surface = false, covered = false;
  };
  std::vector<Outcome> outcomes(static_cast<std::size_t>(options.points));
  std::vector<std::unique_ptr<IrradiancePaths>> paths(
      static_cast<std::size_t>(resolve_thread_count(options.threads)));
  parallel_for_slots(options.threads, outcomes.size(), 1, [&](std::size_t i, int slot) {
    RandomStream random(random_key(options.seed, 0x766572ULL, i));
    const SurfaceRecord& r = *top[std::min(
        top.size() - 1, static_cast<std::size_t>((double(i) + random.uniform()) /
                                                 double(outcomes.size()) * double(top.size())))];
    const Vec3d p = Vec3d(r.position[0], r.position[1], r.position[2]) + cache.origin();
    const Vec3d n = Vec3d(r.normal[0], r.normal[1], r.normal[2]).normalized();
    const auto hit = near_record(world, p, n, r.radius[0], random);
    if (!hit) return;
    Outcome& o = outcomes[i];
    o.on_surface = true;
    o.point.position = hit->position;
    o.point.normal = hit->normal.dot(n) > 0 ? hit->shading_normal : -hit->shading_normal;
    const InterpolatedIrradiance e =
        cache.irradiance(pixel_query(world, hit->position, o.point.normal, 0));
    o.covered = e.records > 0;
    if (!o.covered) return;
    auto& tracer = paths[static_cast<std::size_t>(slot)];
    if (!tracer) tracer = std::make_unique<IrradiancePaths>(world, settings);
    tracer->follow(*hit, o.point.normal, random_key(options.seed, i), options.paths, o.truth);
    o.point.reference = o.truth.mean();
    o.point.reference_error = o.truth.error();
    o.point.cached = luminance(e.irradiance);
  });

  double mean = 0;
  for (const Outcome& o : outcomes) {
    if (!o.on_surface) continue;
    if (!o.covered) {
      ++v.uncovered;
      continue;
    }
    ++v.points;
    mean += o.point.reference;
  }
  if (v.points == 0) return v;
  mean /= v.points;
  std::vector<double> errors;
  double bias = 0, squares = 0;
  for (Outcome& o : outcomes) {
    if (!o.covered) continue;
    o.point.floor = 0.01 * mean;
    const double e = o.point.relative_error();
    bias += o.point.cached - o.point.reference;
    const double scale = std::max(o.point.reference, o.point.floor);
    squares += (o.point.cached - o.truth.half_mean(0)) * (o.point.cached - o.truth.half_mean(1)) /
               (scale * scale);
    errors.push_back(std::abs(e));
    v.worst.push_back(o.point);
  }
  v.bias = mean > 0 ? bias / v.points / mean : 0;
  v.rmse = std::sqrt(std::max(0.0, squares / v.points));
  std::sort(errors.begin(), errors.end());
  std::stable_sort(v.worst.begin(), v.worst.end(), [](const VerifyPoint& a, const VerifyPoint& b) {
    return std::abs(a.relative_error()) > std::abs(b.relative_error());
  });
  v.worst.resize(std::min(v.worst.size(), static_cast<std::size_t>(options.worst_points)));
  v.p95 = errors[static_cast<std::size_t>(0.95 * double(errors.size() - 1))];
  v.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return v;
}

}  // namespace brume
