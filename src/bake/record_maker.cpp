#include "bake/record_maker.h"

#include <algorithm>

#include "bake/work_units.h"
#include "core/parallel.h"
#include "core/random.h"

namespace brume {
namespace {

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

}  // namespace

Vec3d bake_origin(const World& world) {
  if (!world.tracer().bounds().isEmpty()) return world.tracer().centre();
  const Medium& medium = world.medium();
  if (medium.is_vacuum() || medium.is_unbounded()) return Vec3d(0.0);
  return (medium.bounds().min + medium.bounds().max) * 0.5;
}

bool recall(const CacheJournal* journal, SurfaceRecord& record) {
  const SurfaceRecord* known = journal ? journal->find(record.layer(), record.key) : nullptr;
  if (!known) return false;
  const std::uint32_t flags = record.flags;
  record = *known;
  record.flags = flags | (known->flags & kClearFlag);
  return true;
}

RecordMaker::RecordMaker(const Lighting& lighting, const Effects& effects,
                         const BakeSettings& settings, const Vec3d& origin, int threads)
    : lighting_(lighting),
      effects_(effects),
      settings_(settings),
      origin_(origin),
      threads_(threads),
      workers_(static_cast<std::size_t>(resolve_thread_count(threads))) {
  for (Worker& w : workers_)
    w.gatherer = std::make_unique<Gatherer>(lighting_, effects_, settings_.gather);
}

SurfaceRecord RecordMaker::place(const SurfacePoint& point, int layer, int wave) const {
  SurfaceRecord r{};
  const Vec3d local = point.position - origin_;
  for (int a = 0; a < 3; ++a) {
    r.position[a] = static_cast<float>(local[a]);
    r.normal[a] = static_cast<float>(point.normal[a]);
  }
  r.key = record_key(r.position, r.normal, lighting_.world().unit());
  r.flags = record_flags(layer, wave);
  return r;
}

GatherResult RecordMaker::gather(double offset, const HitLight& light, SurfaceRecord& r, int slot) {
  // The point as stored, so that the record is a function of what is in the file.
  const Vec3d normal = vector(r.normal).normalized();
  const GatherPoint at{vector(r.position) + origin_, normal, offset,
                       random_key(settings_.seed, r.key)};
  Worker& worker = workers_[static_cast<std::size_t>(slot)];
  const GatherResult g = worker.gatherer->gather(at, light, worker.counters);
  const RgbGradient gradient = g.terms.sum();
  const Frame frame(normal);
  for (int c = 0; c < 3; ++c) {
    r.irradiance[c] = static_cast<float>(g.irradiance[c]);
    for (int a = 0; a < 3; ++a) r.gradient[3 * c + a] = static_cast<float>(gradient[c][a]);
    r.rotational[2 * c] = static_cast<float>(g.rotational[c].dot(frame.u));
    r.rotational[2 * c + 1] = static_cast<float>(g.rotational[c].dot(frame.v));
  }
  if (settings_.gather.gradient == GradientMode::None)
    std::fill(std::begin(r.rotational), std::end(r.rotational), 0.0f);
  const double clearance =
      lighting_.world().tracer().clearance(vector(r.position) + origin_, normal);
  const double radius = record_radius(g, normal, clearance, settings_, lighting_.world().unit());
  r.radius[0] = r.radius[1] = static_cast<float>(radius);
  if (radius < clearance) r.flags |= kClearFlag;
  r.error = static_cast<float>(g.error);
  const double all = luminance(g.irradiance);
  r.media_share = all > 0 ? static_cast<float>(luminance(g.irradiance_media) / all) : 0;
  return g;
}

void RecordMaker::clamp_by_neighbours(std::span<SurfaceRecord> fresh, int layer,
                                      std::vector<const IrradianceCache*> others) const {
  if (fresh.empty()) return;
  std::vector<SurfaceRecord> sorted(fresh.begin(), fresh.end());
  std::sort(sorted.begin(), sorted.end(), RecordOrder());
  const IrradianceCache peers(std::move(sorted), origin_);
  others.push_back(&peers);
  parallel_for(threads_, fresh.size(), 64, [&](std::size_t i) {
    SurfaceRecord& r = fresh[i];
    const Vec3d p = vector(r.position) + origin_, n = vector(r.normal);
    const double own = r.radius[0];
    double radius = own;
    for (const IrradianceCache* cache : others)
      for (const RecordWeight& w : cache->explain({layer, p, n, own})) {
        const SurfaceRecord& o = *w.record;
        const double d = (vector(o.position) + origin_ - p).length();
        radius = std::min(radius, std::min(o.radius[0], o.radius[1]) + d);
      }
    if (radius < own) {
      r.radius[0] = r.radius[1] = static_cast<float>(radius);
      r.flags |= kRadiusClampedFlag;
    }
  });
}

Counters RecordMaker::counters() const {
  Counters sum;
  for (const Worker& w : workers_) sum += w.counters;
  return sum;
}

}  // namespace brume
