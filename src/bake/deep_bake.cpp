#include "bake/deep_bake.h"

#include <algorithm>
#include <unordered_map>

#include "bake/placement.h"
#include "bake/record_maker.h"
#include "core/parallel.h"
#include "core/random.h"

namespace brume {
namespace {

// Half the cells each way, twice the spacing, and no small radii.
constexpr int kCellsDivisor = 2;
constexpr double kErrorFactor = 2, kMinRadiusFactor = 8;

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

class DeepBake {
 public:
  DeepBake(const Lighting& lighting, const BakeSettings& settings, const Effects& effects,
           const BakeRequest& request, const Vec3d& origin)
      : world_(lighting.world()),
        settings_(deep_settings(settings)),
        request_(request),
        origin_(origin),
        finest_(settings_.min_radius * world_.diagonal()),
        maker_(lighting, effects, settings_, origin, request.threads),
        cache_({}, origin) {}

  bool place_everywhere();
  bool place_at_uncovered_hits();
  std::optional<DeepRecords> solve();

 private:
  using Records = std::vector<SurfaceRecord>;

  bool is_stopped() {
    if (!stopped_ && request_.stop_requested && request_.stop_requested()) stopped_ = true;
    return stopped_;
  }
  void report(double fraction) const {
    if (request_.progress) request_.progress("bounces", fraction);
  }
  bool is_covered(const Vec3d& position, const Vec3d& normal) const {
    return cache_.covers({kDeepLayer, position, normal, finest_}, kCoveredWithin);
  }
  bool bake_wave(const std::vector<SurfacePoint>& points);
  // Gathers again at all records, for gradients: of light that `before` reflects.
  bool add_gradients(Records& records, const IrradianceCache& before);

  const World& world_;
  BakeSettings settings_;
  const BakeRequest& request_;
  Vec3d origin_;
  double finest_;
  RecordMaker maker_;
  IrradianceCache cache_;  // Of records_, whose light is of their first gathers.
  Records records_;
  std::unordered_map<std::uint64_t, DeepRow> rows_;      // By key.
  std::unordered_map<std::uint64_t, double> offsets_;
  std::vector<std::uint64_t> last_wave_;                 // Keys.
  int wave_ = 0;
  std::atomic<bool> stopped_ = false;
};

bool DeepBake::bake_wave(const std::vector<SurfacePoint>& points) {
  Records fresh(points.size());
  std::vector<DeepRow> rows(points.size());
  HitLight lamps;
  lamps.reflect = settings_.bounces > 1;
  parallel_for_slots(request_.threads, points.size(), 1, [&](std::size_t i, int slot) {
    if (is_stopped()) return;
    fresh[i] = maker_.place(points[i], kDeepLayer, wave_);
    const GatherResult g = maker_.gather(points[i].offset, lamps, fresh[i], slot);
    // Never farther than the gap that the record sees, however small: what lies past it may be another
    // room.
    const float gap =
        static_cast<float>(std::max<double>(g.nearest, std::numeric_limits<float>::min()));
    for (float& radius : fresh[i].radius) radius = std::min(radius, gap);
    rows[i] = {g.irradiance_media + g.irradiance_emitted,
               g.irradiance_surface - g.irradiance_emitted, maker_.strata(slot)};
  });
  if (stopped_) return false;
  maker_.clamp_by_neighbours(fresh, kDeepLayer, {&cache_});
  last_wave_.clear();
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    // Two hits may be the very same point.
    if (!rows_.emplace(fresh[i].key, std::move(rows[i])).second) continue;
    offsets_.emplace(fresh[i].key, points[i].offset);
    last_wave_.push_back(fresh[i].key);
    records_.push_back(fresh[i]);
  }
  std::sort(records_.begin(), records_.end(), RecordOrder());
  cache_ = IrradianceCache(records_, origin_);
  wave_ = std::min(wave_ + 1, 255);
  return true;
}

// Each wave is twice as dense as the one before.
bool DeepBake::place_everywhere() {
  const SurfacePoints surfaces(world_.tracer());
  const double coarsest = settings_.max_radius * world_.diagonal();
  const int waves = placement_waves(coarsest, finest_);
  for (int wave = 0; wave < waves; ++wave) {
    report(0.6 * wave / waves);
    const auto points =
        surfaces.points(std::ldexp(coarsest, -wave), random_key(settings_.seed, wave));
    std::vector<std::uint8_t> is_open(points.size());
    parallel_for(request_.threads, points.size(), 256, [&](std::size_t i) {
      is_open[i] = !is_covered(points[i].position, points[i].normal);
    });
    std::vector<SurfacePoint> open;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (is_open[i]) open.push_back(points[i]);
    const double distance = 0.7 * std::max(std::ldexp(coarsest, -wave), finest_);
    if (is_stopped() || !bake_wave(thin(open, distance))) return false;
  }
  return true;
}

// What waves over all surfaces left open and some gather sees becomes a record, until none is left.
bool DeepBake::place_at_uncovered_hits() {
  std::unordered_map<std::uint64_t, const SurfaceRecord*> by_key;
  for (const SurfaceRecord& r : records_) last_wave_.push_back(r.key);
  std::sort(last_wave_.begin(), last_wave_.end());
  last_wave_.erase(std::unique(last_wave_.begin(), last_wave_.end()), last_wave_.end());
  while (!last_wave_.empty()) {
    by_key.clear();
    for (const SurfaceRecord& r : records_) by_key.emplace(r.key, &r);
    std::vector<std::vector<SurfacePoint>> found(last_wave_.size());
    parallel_for(request_.threads, last_wave_.size(), 16, [&](std::size_t i) {
      const std::uint64_t key = last_wave_[i];
      const SurfaceRecord& r = *by_key.at(key);
      const Vec3d receiver = vector(r.position) + origin_ + vector(r.normal) * offsets_.at(key);
      for (const Stratum& s : rows_.at(key).strata) {
        const Vec3d normal = vector(s.normal);
        if (cache_.covers({kDeepLayer, s.hit(receiver), normal, finest_})) continue;
        const Hit hit = world_.tracer().intersect({receiver, vector(s.direction).normalized()});
        if (hit.is_hit()) found[i].push_back({hit.position, normal, hit.offset, 0});
      }
    });
    std::vector<SurfacePoint> open;
    for (const auto& points : found) open.insert(open.end(), points.begin(), points.end());
    if (open.empty()) return true;
    if (is_stopped() || !bake_wave(thin(open, 0.7 * finest_))) return false;
  }
  return true;
}

bool DeepBake::add_gradients(Records& records, const IrradianceCache& before) {
  HitLight light;
  light.reflect = settings_.bounces > 1;
  if (light.reflect) light.cache = &before;
  light.layer = kDeepLayer;
  light.min_radius = finest_;
  std::atomic<std::size_t> done = 0;
  parallel_for_slots(request_.threads, records.size(), 1, [&](std::size_t i, int slot) {
    if (is_stopped()) return;
    SurfaceRecord again = records[i];
    maker_.gather(offsets_.at(again.key), light, again, slot);
    // Where it lies, how far it reaches and what it receives stay.
    std::copy_n(again.gradient, 9, records[i].gradient);
    std::copy_n(again.rotational, 6, records[i].rotational);
    records[i].error = again.error;
    records[i].media_share = again.media_share;
    if (slot == 0) report(0.7 + 0.3 * double(++done) / double(records.size()));
  });
  return !stopped_;
}

std::optional<DeepRecords> DeepBake::solve() {
  std::vector<DeepRow> rows;
  for (const SurfaceRecord& r : records_) rows.push_back(std::move(rows_.at(r.key)));
  const SurfaceTransport transport(cache_, rows, finest_, request_.threads);
  report(0.7);
  const DeepSolution solution = solve_deep_light(transport, rows, settings_.bounces);
  const auto with_light = [&](const DeepLight& light) {
    Records records = records_;
    for (std::size_t i = 0; i < records.size(); ++i) {
      for (int c = 0; c < 3; ++c) records[i].irradiance[c] = static_cast<float>(light[i][c]);
      std::fill(std::begin(records[i].gradient), std::end(records[i].gradient), 0.0f);
      std::fill(std::begin(records[i].rotational), std::end(records[i].rotational), 0.0f);
    }
    return records;
  };
  DeepRecords deep;
  deep.records = with_light(solution.light);
  deep.orders = solution.orders;
  deep.truncation_bound = solution.truncation_bound;
  const IrradianceCache before(with_light(solution.before), origin_);
  if (!add_gradients(deep.records, before)) return std::nullopt;
  deep.counters = maker_.counters();
  return deep;
}

}  // namespace

bool needs_deep_records(const World& world, const BakeSettings& settings, const Effects& effects) {
  const bool is_lit_unreflected =
      effects.scattering || effects.emission || world.has_gathered_emitters();
  return effects.indirect && (settings.bounces > 1 || is_lit_unreflected);
}

BakeSettings deep_settings(const BakeSettings& settings) {
  BakeSettings deep = settings;
  deep.gather.cells_theta = std::max(4, settings.gather.cells_theta / kCellsDivisor);
  deep.gather.cells_phi = std::max(8, settings.gather.cells_phi / kCellsDivisor);
  deep.error *= kErrorFactor;
  deep.min_radius = std::min(settings.max_radius, settings.min_radius * kMinRadiusFactor);
  return deep;
}

std::optional<DeepRecords> bake_deep_records(const Lighting& lighting, const BakeSettings& settings,
                                             const Effects& effects, const BakeRequest& request,
                                             const Vec3d& origin) {
  DeepBake bake(lighting, settings, effects, request, origin);
  if (!bake.place_everywhere() || !bake.place_at_uncovered_hits()) return std::nullopt;
  return bake.solve();
}

}  // namespace brume
