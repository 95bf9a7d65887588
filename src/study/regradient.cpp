#include "study/regradient.h"

#include <algorithm>

#include "core/random.h"

namespace brume {
namespace {

std::vector<SurfaceRecord> top_records(const IrradianceCache& cache) {
  std::vector<SurfaceRecord> top;
  for (const SurfaceRecord& r : cache.records())
    if (r.layer() == kTopLayer) top.push_back(r);
  return top;
}

// Where a bake gathered the record, from what is in the file: the position as stored, and the
// offset of the surface that it lies on.
GatherPoint gather_point(const StudyScene& scene, const SurfaceRecord& r, const Vec3d& origin) {
  GatherPoint at;
  at.position = Vec3d(r.position[0], r.position[1], r.position[2]) + origin;
  at.normal = Vec3d(r.normal[0], r.normal[1], r.normal[2]).normalized();
  const double reach = 1e-5 * scene.world().diagonal();
  const Hit hit =
      scene.world().tracer().intersect({at.position + at.normal * reach, -at.normal}, 2 * reach);
  if (hit.is_hit()) at.offset = hit.offset;
  at.key = random_key(scene.settings().seed, r.key);
  return at;
}

void set_gradient(SurfaceRecord& r, const PointGather& g, std::size_t mode) {
  const Vec3d normal = Vec3d(r.normal[0], r.normal[1], r.normal[2]).normalized();
  const Frame frame(normal);
  const bool is_none = kGradientModes[mode] == GradientMode::None;
  for (int c = 0; c < 3; ++c) {
    for (int a = 0; a < 3; ++a) r.gradient[3 * c + a] = static_cast<float>(g.gradient[mode][c][a]);
    r.rotational[2 * c] = is_none ? 0.0f : static_cast<float>(g.rotational[c].dot(frame.u));
    r.rotational[2 * c + 1] = is_none ? 0.0f : static_cast<float>(g.rotational[c].dot(frame.v));
  }
}

}  // namespace

RegradientResult regradient(const StudyScene& scene, const IrradianceCache& cache,
                            const StudyRun& run) {
  std::vector<SurfaceRecord> records = top_records(cache);
  std::vector<GatherPoint> points;
  points.reserve(records.size());
  for (const SurfaceRecord& r : records) points.push_back(gather_point(scene, r, cache.origin()));
  GatherOptions options = scene.settings().gather;
  options.gradient = GradientMode::Full;
  const std::vector<PointGather> gathers =
      gather_points(scene, options, light_below(cache, scene.settings(), scene.world(), run.threads), points,
                    "gradients of every mode", run);
  RegradientResult result;
  for (std::size_t i = 0; i < records.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      const double stored = records[i].irradiance[c];
      const double now = static_cast<float>(gathers[i].irradiance[c]);
      if (now != stored)
        result.largest_change =
            std::max(result.largest_change, std::abs(now - stored) / std::max(now, stored));
    }
  for (std::size_t m = 0; m < kModeCount; ++m) {
    for (std::size_t i = 0; i < records.size(); ++i) set_gradient(records[i], gathers[i], m);
    result.caches[m] = IrradianceCache(records, cache.origin());
  }
  return result;
}

PairedCost compare_gather_cost(const StudyScene& scene, const IrradianceCache& cache,
                               GradientMode first, GradientMode second, std::size_t gathers,
                               const StudyRun& run) {
  const std::vector<SurfaceRecord> records = top_records(cache);
  PairedCost cost;
  if (records.empty()) return cost;
  std::array<std::unique_ptr<Gatherer>, 2> gatherers;
  for (std::size_t g = 0; g < 2; ++g) {
    GatherOptions options = scene.settings().gather;
    options.gradient = g == 0 ? first : second;
    gatherers[g] = std::make_unique<Gatherer>(scene.lighting(), scene.effects(), options);
  }
  const HitLight light = light_below(cache, scene.settings(), scene.world(), run.threads);
  const std::size_t count = std::min(gathers, records.size());
  const auto point = [&](std::size_t i) {  // Spread over all records.
    return gather_point(scene, records[i * records.size() / count], cache.origin());
  };
  Counters counters;
  // Tables and caches are warm from here on.
  for (const auto& gatherer : gatherers) gatherer->gather(point(0), light, counters);
  std::vector<double> ratios;
  std::array<double, 2> sum{};
  for (int pair = 0; pair < kCostPairs; ++pair) {
    run.check_stop();
    const std::size_t begin = count * static_cast<std::size_t>(pair) / kCostPairs;
    const std::size_t end = count * static_cast<std::size_t>(pair + 1) / kCostPairs;
    if (begin == end) continue;
    std::array<double, 2> seconds{};
    for (std::size_t i = begin; i < end; ++i)
      // Gather by gather in turn, so that what disturbs the machine meets both alike.
      for (std::size_t turn = 0; turn < 2; ++turn) {
        const std::size_t g = (i + turn) % 2;
        const double start = thread_cpu_seconds();
        gatherers[g]->gather(point(i), light, counters);
        seconds[g] += thread_cpu_seconds() - start;
      }
    ratios.push_back(seconds[0] / seconds[1]);
    for (std::size_t g = 0; g < 2; ++g) sum[g] += seconds[g];
    if (run.progress) run.progress("cost of gradients", double(pair + 1) / kCostPairs);
  }
  std::sort(ratios.begin(), ratios.end());
  cost.pairs = static_cast<int>(ratios.size());
  cost.ratio = ratios[ratios.size() / 2];
  // Order statistics 4 and 12 of 15 hold the median with 96.5 % (binomial).
  cost.low = ratios[ratios.size() / 5];
  cost.high = ratios[ratios.size() - 1 - ratios.size() / 5];
  cost.gathers = count;
  cost.ms_first = 1e3 * sum[0] / double(count);
  cost.ms_second = 1e3 * sum[1] / double(count);
  return cost;
}

}  // namespace brume
