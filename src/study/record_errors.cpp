#include "study/record_errors.h"

#include <algorithm>
#include <chrono>

#include "core/parallel.h"
#include "core/random.h"

namespace brume {
namespace {

constexpr double kLeast = 0.05;  // Of the mean: errors of darker records are not over themselves.
constexpr double kTruthPart = 0.2;  // Of the median error: how well truths must be known.
constexpr int kFinerCells = 2;      // Each way.

// One record against gathers at its place.
struct Trial {
  const SurfaceRecord* record = nullptr;
  int gathers = 0;
  double sum = 0, squares = 0;

  double value() const {
    return luminance(RgbD(record->irradiance[0], record->irradiance[1], record->irradiance[2]));
  }
  double truth() const { return sum / gathers; }
  double truth_error() const {
    const double variance = (squares - sum * sum / gathers) / (gathers - 1);
    return std::sqrt(std::max(0.0, variance) / gathers);
  }
};

double quantile(const std::vector<double>& sorted, double part) {
  return sorted[static_cast<std::size_t>(part * double(sorted.size() - 1))];
}

std::vector<Trial> choose_records(const IrradianceCache& cache, int count) {
  std::vector<const SurfaceRecord*> top;
  for (const SurfaceRecord& r : cache.records())
    if (r.layer() == kTopLayer) top.push_back(&r);
  const std::size_t n = std::min(top.size(), static_cast<std::size_t>(count));
  std::vector<Trial> trials(n);
  for (std::size_t i = 0; i < n; ++i) trials[i].record = top[i * top.size() / n];
  return trials;
}

double mean_truth(const std::vector<Trial>& trials) {
  double sum = 0;
  for (const Trial& t : trials) sum += t.truth();
  return sum / double(trials.size());
}

std::vector<double> sorted_errors(const std::vector<Trial>& trials, double mean) {
  std::vector<double> errors;
  for (const Trial& t : trials) {
    const double over = std::max(t.truth(), kLeast * mean);
    errors.push_back(over > 0 ? std::abs(t.value() - t.truth()) / over : 0);
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

double calibration_of(const std::vector<Trial>& trials, double mean) {
  std::vector<double> squares;
  for (const Trial& t : trials) {
    if (!(t.truth() > kLeast * mean)) continue;
    const double expected =
        double(t.record->error) * t.record->error + t.truth_error() * t.truth_error();
    const double off = t.value() - t.truth();
    if (expected > 0) squares.push_back(off * off / expected);
  }
  if (squares.empty()) return 0;
  std::sort(squares.begin(), squares.end());
  const std::size_t kept = squares.size() - squares.size() / 100;
  double sum = 0;
  for (std::size_t i = 0; i < kept; ++i) sum += squares[i];
  return std::sqrt(sum / double(kept));
}

}  // namespace

RecordErrors measure_record_errors(const Lighting& lighting, const BakeSettings& settings,
                                   const IrradianceCache& cache,
                                   const RecordErrorOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  const World& world = lighting.world();
  RecordErrors result;
  std::vector<Trial> trials = choose_records(cache, options.records);
  if (trials.empty()) return result;

  const Effects effects = plan_effects(world, settings.bounces, settings.volume_bounces);
  GatherOptions finer = settings.gather;
  finer.cells_theta *= kFinerCells;
  finer.cells_phi *= kFinerCells;
  finer.gradient = GradientMode::None;
  const HitLight below = light_below(cache, settings, world, options.threads);
  std::vector<std::unique_ptr<Gatherer>> gatherers(
      static_cast<std::size_t>(resolve_thread_count(options.threads)));
  std::vector<Trial*> open;
  for (Trial& t : trials) open.push_back(&t);
  for (int gathers = options.first_gathers; !open.empty(); gathers *= 2) {
    parallel_for_slots(options.threads, open.size(), 1, [&](std::size_t i, int slot) {
      if (!gatherers[slot]) gatherers[slot] = std::make_unique<Gatherer>(lighting, effects, finer);
      Trial& t = *open[i];
      const SurfaceRecord& r = *t.record;
      const Vec3d p = Vec3d(r.position[0], r.position[1], r.position[2]) + cache.origin();
      const Vec3d n = Vec3d(r.normal[0], r.normal[1], r.normal[2]).normalized();
      Counters counters;
      for (; t.gathers < gathers; ++t.gathers) {
        const std::uint64_t key = random_key(options.seed, r.key, t.gathers);
        const GatherPoint at{p, n, world.tracer().offset_at(p), key};
        const double e = luminance(gatherers[slot]->gather(at, below, counters).irradiance);
        t.sum += e;
        t.squares += e * e;
      }
    });
    result.mean = mean_truth(trials);
    const double wanted = kTruthPart * quantile(sorted_errors(trials, result.mean), 0.5);
    std::erase_if(open, [&](const Trial* t) {
      return t->gathers >= options.most_gathers ||
             t->truth_error() <= wanted * std::max(t->truth(), kLeast * result.mean);
    });
  }

  const std::vector<double> errors = sorted_errors(trials, result.mean);
  result.records = static_cast<int>(trials.size());
  result.median = quantile(errors, 0.5);
  result.p99 = quantile(errors, 0.99);
  result.worst = errors.back();
  result.calibration = calibration_of(trials, result.mean);
  std::vector<double> known;
  for (const Trial& t : trials) {
    const double over = std::max(t.truth(), kLeast * result.mean);
    if (!(over > 0)) continue;
    known.push_back(t.truth_error() / over);
    if (std::abs(t.value() - t.truth()) / over < result.worst) continue;
    const SurfaceRecord& r = *t.record;
    result.worst_position = Vec3d(r.position[0], r.position[1], r.position[2]) + cache.origin();
    result.worst_value = t.value();
    result.worst_truth = t.truth();
  }
  std::sort(known.begin(), known.end());
  if (!known.empty()) result.truth_error = quantile(known, 0.5);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

}  // namespace brume
