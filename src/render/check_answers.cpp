#include "render/check_answers.h"

#include <algorithm>

#include "core/lattice.h"
#include "core/parallel.h"
#include "core/random.h"
#include "geom/surface_area.h"
#include "render/irradiance_paths.h"
#include "render/picture_irradiance.h"
#include "scene/camera_rays.h"

namespace brume {
namespace {

// A ray counts 1, a lookup of density less: a CPU second holds about 1.5 million.
constexpr double kLookupWork = 0.05;
constexpr double kLeastWork = 1e5, kMostWork = 3e6;
// Of a gather's rays, whose hits ask for shadows and records besides: about a twentieth of their
// time.
constexpr double kPartOfBake = 0.15;
constexpr double kRecordsAPixel = 0.3;
constexpr int kPilotPaths = 8, kFewestPaths = 16, kMostPaths = 4096;

// From the request and the deep records, which all shards know.
double budget(const BakeSettings& settings, const IrradianceCache& cache,
              const BakeRequest& request) {
  double records = static_cast<double>(cache.volume()->size());
  for (const SurfaceRecord& r : cache.records()) records += r.layer() == kDeepLayer;
  if (request.everywhere) records *= 2;
  for (const BakeView& view : request.views) records += kRecordsAPixel * view.width * view.height;
  const double rays = records * settings.gather.cell_count();
  return std::clamp(kPartOfBake * rays, kLeastWork, kMostWork);
}

// Finds who answers as pixel queries do, but asks every record in reach whether it sees the point:
// what parts of a cache say then unites to what the whole says.
void find_records(const World& world, const IrradianceCache& cache, CheckedPoint& point) {
  IrradianceQuery query = pixel_query(world, point.position, point.normal, point.footprint);
  const int most = query.stretches;
  query.stretches = 0;
  for (int stretches = 0; stretches <= most; ++stretches, query.min_radius *= 2) {
    for (const RecordWeight& w : cache.explain(query)) point.keys.push_back(w.record->key);
    if (point.keys.empty()) continue;
    point.stretches = stretches;
    std::sort(point.keys.begin(), point.keys.end());
    return;
  }
}

bool is_of_shard(std::size_t point, const Shard& shard) {
  return point % shard.count == shard.index;
}

bool knows_truths(const CheckedRequest& known, std::uint64_t request,
                  const std::vector<AskedPoint>& asked, const Shard& shard) {
  if (known.request != request || known.points.size() != asked.size()) return false;
  for (std::size_t i = 0; i < asked.size(); ++i)
    if (is_of_shard(i, shard) &&
        (known.points[i].truth.paths == 0 || known.points[i].position != asked[i].hit.position))
      return false;
  return true;
}

double work_of(const IrradiancePaths& paths) {
  return double(paths.rays()) + kLookupWork * double(paths.lookups());
}

}  // namespace

std::vector<AskedPoint> asked_points(const World& world, const BakeRequest& request, int count,
                                     std::uint64_t seed) {
  constexpr int kTries = 16;  // For each point.
  std::vector<AskedPoint> points;
  RandomStream random(random_key(seed, 0x636865636bULL));
  const SurfaceArea surfaces(world.tracer());
  if (request.everywhere && !(surfaces.area() > 0)) return points;
  std::vector<CameraRays> cameras;
  for (const BakeView& view : request.views)
    cameras.emplace_back(view.camera, view.width, view.height);
  if (!request.everywhere && cameras.empty()) return points;
  // Its first points are as evenly spread as all.
  const Vec2d shift = random.uniform2();
  for (int i = 0; i < kTries * count && static_cast<int>(points.size()) < count; ++i) {
    const Vec2d at = lattice_point(i, shift);
    AskedPoint point;
    if (request.everywhere) {
      point.hit = surfaces.point(at.x, random.uniform2());
      point.normal = at.y < 0.5 ? point.hit.shading_normal : -point.hit.shading_normal;
    } else {
      const std::size_t v = static_cast<std::size_t>(i) % cameras.size();
      const Ray ray = cameras[v].ray(at.x * request.views[v].width, at.y * request.views[v].height);
      point.hit = world.tracer().intersect(ray);
      if (!point.hit.is_hit()) continue;
      const double side = point.hit.normal.dot(ray.direction) < 0 ? 1 : -1;
      point.normal = point.hit.shading_normal * side;
      point.footprint = kFootprintPixels * cameras[v].pixel_angle() * point.hit.t;
    }
    if (world.material(point.hit).reflects()) points.push_back(point);
  }
  return points;
}

CheckedRequest check_answers(const Lighting& lighting, const BakeSettings& settings,
                             const IrradianceCache& cache, const BakeRequest& request, int count,
                             const Scattered& scattered, const CheckedRequest* known) {
  const World& world = lighting.world();
  const int threads = request.threads;
  const Effects effects = plan_effects(world, settings.bounces, settings.volume_bounces);
  CheckedRequest checked{request_hash(request), {}};
  if (!effects.indirect) return checked;
  const std::vector<AskedPoint> asked = asked_points(world, request, count, settings.seed);
  checked.points.resize(asked.size());
  const auto is_ours = [&](std::size_t i) { return is_of_shard(i, request.shard); };
  const bool is_known = known && knows_truths(*known, checked.request, asked, request.shard);
  const auto key_of = [&](std::size_t i) { return random_key(settings.seed, 0x7472757468ULL, i); };
  const std::size_t slots = static_cast<std::size_t>(resolve_thread_count(threads));

  // The first paths of every point, in every shard, say how many are affordable.
  std::vector<std::unique_ptr<IrradiancePaths>> paths(slots);
  const auto paths_of = [&](int slot) -> IrradiancePaths& {
    auto& p = paths[static_cast<std::size_t>(slot)];
    if (!p) p = std::make_unique<IrradiancePaths>(world, settings);
    return *p;
  };
  std::vector<double> work(asked.size());
  parallel_for_slots(threads, asked.size(), 1, [&](std::size_t i, int slot) {
    CheckedPoint& point = checked.points[i];
    point.position = asked[i].hit.position;
    point.normal = asked[i].normal;
    point.footprint = asked[i].footprint;
    find_records(world, cache, point);
    if (is_known) {
      point.truth = known->points[i].truth;
      return;
    }
    IrradiancePaths& tracer = paths_of(slot);
    const double before = work_of(tracer);
    tracer.follow(asked[i].hit, asked[i].normal, key_of(i), kPilotPaths, point.truth);
    work[i] = work_of(tracer) - before;
  });
  double work_of_one = 0;
  for (const double w : work) work_of_one += w / kPilotPaths;
  const double affordable = work_of_one > 0 ? budget(settings, cache, request) / work_of_one : 0;
  const int most =
      2 * static_cast<int>(std::clamp<double>(affordable, kFewestPaths, kMostPaths) / 2);

  const bool needs_gathers =
      std::any_of(checked.points.begin(), checked.points.end(),
                  [](const CheckedPoint& p) { return p.stretches == CheckedPoint::kNobody; });
  const HitLight below =
      needs_gathers ? light_below(cache, settings, world, threads, scattered) : HitLight();
  std::vector<std::unique_ptr<PictureIrradiance>> gatherers(slots);
  parallel_for_slots(threads, asked.size(), 1, [&](std::size_t i, int slot) {
    CheckedPoint& point = checked.points[i];
    if (!is_ours(i)) {
      point.truth = {};
      return;
    }
    if (!is_known)
      paths_of(slot).follow(asked[i].hit, asked[i].normal, key_of(i), most, point.truth);
    if (point.stretches != CheckedPoint::kNobody) return;
    auto& gatherer = gatherers[static_cast<std::size_t>(slot)];
    if (!gatherer)
      gatherer = std::make_unique<PictureIrradiance>(lighting, effects, settings, cache, below);
    Counters counters;
    point.gathered = luminance(gatherer->gather(asked[i].hit, asked[i].normal,
                                                random_key(settings.seed, 0x6173ULL, i), counters));
  });
  return checked;
}

}  // namespace brume
