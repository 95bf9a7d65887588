#include "render/answer_check.h"

#include <chrono>

#include "core/parallel.h"
#include "core/random.h"
#include "geom/surface_area.h"
#include "render/picture_irradiance.h"
#include "render/reference_paths.h"
#include "scene/camera_rays.h"

namespace brume {
namespace {

// A ray counts 1, a lookup of density less: a CPU second holds about 1.5 million.
constexpr double kLookupWork = 0.05;
constexpr double kLeastWork = 1e5, kMostWork = 3e6;
// Of a gather's rays, whose hits ask for shadows and records besides: about a twentieth of their time.
constexpr double kPartOfBake = 0.15;
constexpr int kPilotPaths = 8, kFewestPaths = 16, kMostPaths = 4096;

// The truth at a point, by two independent halves of its paths.
struct Trial {
  RgbD answer;
  bool is_gathered = false;
  double half[2] = {0, 0};  // Sums of luminance.
  double squares = 0;
  int paths = 0;
  double work = 0;

  double value() const { return luminance(answer); }
  double truth() const { return (half[0] + half[1]) / paths; }
  double truth_error() const {
    const double mean = truth();
    return std::sqrt(std::max(0.0, squares / paths - mean * mean) / (paths - 1));
  }
  // An estimate of (answer - truth)^2 without the paths' own variance.
  double square() const {
    return (value() - 2 * half[0] / paths) * (value() - 2 * half[1] / paths);
  }
  // Of that estimate: each half is twice as uncertain as both.
  double square_variance() const {
    const double half_variance = 2 * truth_error() * truth_error();
    return half_variance * (2 * std::max(0.0, square()) + half_variance);
  }
};

double budget(const BakeSettings& settings, const IrradianceCache& cache) {
  const double bake = double(cache.size()) * settings.gather.cell_count();
  return std::clamp(kPartOfBake * bake, kLeastWork, kMostWork);
}

struct MeanAndError {
  double mean = 0, error = 0;
};
template <typename Value>
MeanAndError mean_of(const std::vector<Trial>& trials, const Value& value) {
  const double n = static_cast<double>(trials.size());
  double sum = 0, squares = 0;
  for (const Trial& t : trials) sum += value(t) / n;
  for (const Trial& t : trials) squares += (value(t) - sum) * (value(t) - sum);
  return {sum, n > 1 ? std::sqrt(squares / (n * (n - 1))) : 0};
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
  // A lattice of the golden ratio's kin, whose first points are as evenly spread as all [Rob18].
  const Vec2d shift = random.uniform2();
  for (int i = 0; i < kTries * count && static_cast<int>(points.size()) < count; ++i) {
    const Vec2d at(std::fmod(shift.x + 0.7548776662466927 * i, 1.0),
                   std::fmod(shift.y + 0.5698402909980532 * i, 1.0));
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

bool AnswerCheck::is_doubtful() const {
  constexpr double kMostBias = 0.03, kMostRmse = 0.1;
  return std::abs(bias) - 3 * bias_error > kMostBias || rmse_low > kMostRmse;
}

AnswerCheck check_answers(const Lighting& lighting, const BakeSettings& settings,
                          const IrradianceCache& cache, const std::vector<AskedPoint>& points,
                          int threads, const Scattered& scattered) {
  const auto start = std::chrono::steady_clock::now();
  const World& world = lighting.world();
  const Effects effects = plan_effects(world, settings.bounces, settings.volume_bounces);
  AnswerCheck check;
  if (points.empty() || !effects.indirect) return check;

  std::vector<Trial> trials(points.size());
  bool needs_gathers = false;
  for (const AskedPoint& p : points)
    needs_gathers |= !cache.covers(pixel_query(world, p.hit.position, p.normal, p.footprint));
  const HitLight below =
      needs_gathers ? light_below(cache, settings, world, threads, scattered) : HitLight();
  PathTracerOptions options;
  options.transport = Transport::Cached;
  options.bounces = settings.bounces;
  options.volume_bounces = settings.volume_bounces;

  struct Worker {
    Worker(const Lighting& l, const Effects& e, const BakeSettings& s, const IrradianceCache& c,
           const HitLight& b, const PathTracerOptions& o)
        : irradiance(l, e, s, c, b), paths(l.world(), o) {}
    PictureIrradiance irradiance;
    ReferencePaths paths;
  };
  std::vector<std::unique_ptr<Worker>> workers(
      static_cast<std::size_t>(resolve_thread_count(threads)));
  const auto worker = [&](int slot) -> Worker& {
    auto& w = workers[static_cast<std::size_t>(slot)];
    if (!w) w = std::make_unique<Worker>(lighting, effects, settings, cache, below, options);
    return *w;
  };
  // Paths of even and odd numbers are the halves.
  const auto follow = [&](std::size_t i, ReferencePaths& paths, int count) {
    Trial& t = trials[i];
    const std::uint64_t key = random_key(settings.seed, 0x7472757468ULL, i);
    const double before = double(paths.rays()) + kLookupWork * double(paths.lookups());
    for (; t.paths < count; ++t.paths) {
      const int half = t.paths % 2;
      const SamplePoints spread(random_key(key, half), static_cast<std::uint32_t>(t.paths / 2));
      RandomStream random(random_key(key, half, t.paths));
      const double e = luminance(
          paths.indirect_irradiance(points[i].hit, points[i].normal, spread.square(0), random));
      t.half[half] += e;
      t.squares += e * e;
    }
    t.work += double(paths.rays()) + kLookupWork * double(paths.lookups()) - before;
  };
  parallel_for_slots(threads, trials.size(), 1, [&](std::size_t i, int slot) {
    const AskedPoint& p = points[i];
    Counters counters;
    const InterpolatedIrradiance e = worker(slot).irradiance.answer(
        p.hit, p.normal, p.footprint, true, random_key(settings.seed, 0x6173ULL, i), counters);
    trials[i].answer = e.irradiance;
    trials[i].is_gathered = e.records == 0;
    follow(i, worker(slot).paths, kPilotPaths);
  });
  double work = 0;
  for (const Trial& t : trials) work += t.work / kPilotPaths;
  const double affordable = work > 0 ? budget(settings, cache) / work : kFewestPaths;
  check.paths = 2 * static_cast<int>(std::clamp<double>(affordable, kFewestPaths, kMostPaths) / 2);
  parallel_for_slots(threads, trials.size(), 1,
                     [&](std::size_t i, int slot) { follow(i, worker(slot).paths, check.paths); });

  check.points = static_cast<int>(trials.size());
  for (const Trial& t : trials) check.gathered += t.is_gathered;
  check.truth = mean_of(trials, [](const Trial& t) { return t.truth(); }).mean;
  check.answer = mean_of(trials, [](const Trial& t) { return t.value(); }).mean;
  const double scale = std::max(check.truth, check.answer);
  if (scale > 0) {
    const MeanAndError off = mean_of(trials, [](const Trial& t) { return t.value() - t.truth(); });
    check.bias = off.mean / scale;
    check.bias_error = off.error / scale;
    const double square = mean_of(trials, [](const Trial& t) { return t.square(); }).mean;
    double variance = 0;
    for (const Trial& t : trials) variance += t.square_variance();
    const double error = std::sqrt(variance) / double(trials.size());
    const auto root = [&](double errors) {
      return std::sqrt(std::max(0.0, square + errors * error)) / scale;
    };
    check.rmse = root(0);
    check.rmse_low = root(-2);
    check.rmse_high = root(2);
  }
  double most = -kInfinity;
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const Trial& t = trials[i];
    const double sure = std::abs(t.value() - t.truth()) - 2 * t.truth_error();
    if (!(sure > most)) continue;
    most = sure;
    check.worst_position = points[i].hit.position;
    check.worst_truth = t.truth();
    check.worst_truth_error = t.truth_error();
    check.worst_answer = t.value();
  }
  check.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return check;
}

}  // namespace brume
