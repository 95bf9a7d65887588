#include "bake/deep_bake.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <unordered_map>

#include "bake/light_solve.h"
#include "bake/placement.h"
#include "bake/record_maker.h"
#include "bake/volume_placement.h"
#include "core/parallel.h"
#include "core/random.h"

namespace brume {
namespace {

// Half the cells each way, twice the spacing, and no small radii.
constexpr int kCellsDivisor = 2;
constexpr double kErrorFactor = 2, kMinRadiusFactor = 8;
// Of a stratum, that stand for the medium along it. A row has hundreds of strata, so that more
// change nothing, but a little where directions matter (docs/decisions/0009).
constexpr int kMediumPoints = 1, kMediumPointsOfLobes = 2;
// In a journal, deep records as their second gathers found them.
constexpr int kSolvedLayer = 2;
constexpr std::uint64_t kKeyOfSolution = 0x736f6c7574696f6eULL;  // And the solve's note.

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

// First gathers keep strata, and see lamps alone.
BakeSettings first_settings(BakeSettings deep, const Medium& medium) {
  deep.gather.medium_points = harmonic_order(medium) > 0 ? kMediumPointsOfLobes : kMediumPoints;
  return deep;
}

class DeepBake {
 public:
  DeepBake(const Lighting& lighting, const BakeSettings& settings, const Effects& effects,
           const BakeRequest& request, const Vec3d& origin)
      : lighting_(lighting),
        world_(lighting.world()),
        settings_(deep_settings(settings)),
        first_settings_(first_settings(settings_, world_.medium())),
        effects_(effects),
        request_(request),
        origin_(origin),
        finest_(settings_.min_radius * world_.diagonal()),
        maker_(lighting, effects, first_settings_, origin, request.threads),
        medium_(lighting, first_settings_, effects, origin, request.threads, request.journal),
        cache_({}, origin) {}

  std::optional<DeepRecords> bake();

 private:
  using Records = std::vector<SurfaceRecord>;
  struct Source {
    DeepRow row;
    double offset = 0;  // Clears the surface.
  };

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
  bool place_everywhere();
  bool place_at_uncovered_hits();
  bool bake_wave(const std::vector<SurfacePoint>& points);
  // What an earlier run's first gather found at a record that is placed.
  bool find_first(SurfaceRecord& record, DeepRow& row) const;
  // Hits of reflecting strata that no record covers.
  void add_uncovered(const Vec3d& receiver, const Strata& strata,
                     std::vector<SurfacePoint>& points) const;
  Records with_light(const std::vector<RgbD>& light) const;
  // Gathers again at surface records, now that the light is known, for gradients. Records of the
  // medium are interpolated by weights that nearly reproduce what is linear, and need none.
  bool add_gradients(Records& surface, const std::vector<RgbD>& before);
  DeepSolution solve();
  void store(const DeepSolution& solution, VolumeRecords& volume) const;

  const Lighting& lighting_;
  const World& world_;
  BakeSettings settings_, first_settings_;
  const Effects& effects_;
  const BakeRequest& request_;
  Vec3d origin_;
  double finest_;
  RecordMaker maker_;
  VolumePlacement medium_;
  IrradianceCache cache_;  // Of records_, whose light is of their first gathers.
  Records records_;
  std::unordered_map<std::uint64_t, Source> sources_;  // By key.
  std::vector<std::uint64_t> last_wave_;               // Keys.
  std::shared_ptr<const VolumeCache> volume_;          // What the solve found,
  std::shared_ptr<const IncidentField> scattered_;     // and as gathers ask for it.
  Counters counters_;
  int wave_ = 0;
  std::atomic<bool> stopped_ = false;
};

bool DeepBake::find_first(SurfaceRecord& record, DeepRow& row) const {
  if (!request_.journal) return false;
  std::optional<DeepRow> found = row_of(request_.journal->find_note(record.key));
  if (!found || found->unreflected.size() != 1 || !recall(request_.journal, record)) return false;
  row = std::move(*found);
  return true;
}

bool DeepBake::bake_wave(const std::vector<SurfacePoint>& points) {
  Records fresh(points.size());
  std::vector<DeepRow> rows(points.size());
  HitLight lamps;
  lamps.reflect = settings_.bounces > 1;
  parallel_for_slots(request_.threads, points.size(), 1, [&](std::size_t i, int slot) {
    if (is_stopped()) return;
    fresh[i] = maker_.place(points[i], kDeepLayer, wave_);
    if (find_first(fresh[i], rows[i])) return;
    const GatherResult g = maker_.gather(points[i].offset, lamps, fresh[i], slot);
    // Never farther than the gap that the record sees, however small: what lies past it may be
    // another room.
    const float gap =
        static_cast<float>(std::max<double>(g.nearest, std::numeric_limits<float>::min()));
    for (float& radius : fresh[i].radius) radius = std::min(radius, gap);
    rows[i] = {{g.irradiance_media + g.irradiance_emitted},
               {g.irradiance_surface - g.irradiance_emitted},
               maker_.strata(slot)};
    if (request_.journal) request_.journal->add(fresh[i], bytes_of(rows[i]));
  });
  if (stopped_) return false;
  maker_.clamp_by_neighbours(fresh, kDeepLayer, {&cache_});
  last_wave_.clear();
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    // Two hits may be the very same point.
    if (!sources_.emplace(fresh[i].key, Source{std::move(rows[i]), points[i].offset}).second)
      continue;
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

void DeepBake::add_uncovered(const Vec3d& receiver, const Strata& strata,
                             std::vector<SurfacePoint>& points) const {
  for (const Stratum& s : strata.strata) {
    const Vec3d normal = vector(s.normal);
    if (!s.reflects() ||
        cache_.covers({kDeepLayer, receiver + s.way() * double(s.distance), normal, finest_}))
      continue;
    const Hit hit = world_.tracer().intersect({receiver, s.way().normalized()});
    if (hit.is_hit()) points.push_back({hit.position, normal, hit.offset, 0});
  }
}

// What waves over all surfaces left open and some gather sees becomes a record, until none is left.
bool DeepBake::place_at_uncovered_hits() {
  const std::vector<DeepRow>& of_medium = medium_.rows();
  std::vector<std::vector<SurfacePoint>> found(of_medium.size());
  parallel_for(request_.threads, found.size(), 16, [&](std::size_t i) {
    add_uncovered(vector(medium_.records().records[i].position) + origin_, of_medium[i].strata,
                  found[i]);
  });
  last_wave_.clear();
  for (const SurfaceRecord& r : records_) last_wave_.push_back(r.key);
  for (;;) {
    std::unordered_map<std::uint64_t, const SurfaceRecord*> by_key;
    for (const SurfaceRecord& r : records_) by_key.emplace(r.key, &r);
    const std::size_t first = found.size();
    found.resize(first + last_wave_.size());
    parallel_for(request_.threads, last_wave_.size(), 16, [&](std::size_t i) {
      const SurfaceRecord& r = *by_key.at(last_wave_[i]);
      const Source& source = sources_.at(r.key);
      add_uncovered(vector(r.position) + origin_ + vector(r.normal) * source.offset,
                    source.row.strata, found[first + i]);
    });
    std::vector<SurfacePoint> open;
    for (const auto& points : found) open.insert(open.end(), points.begin(), points.end());
    found.clear();
    if (open.empty()) return true;
    if (is_stopped() || !bake_wave(thin(open, 0.7 * finest_))) return false;
  }
}

DeepBake::Records DeepBake::with_light(const std::vector<RgbD>& light) const {
  Records records = records_;
  for (std::size_t i = 0; i < records.size(); ++i) {
    for (int c = 0; c < 3; ++c) records[i].irradiance[c] = static_cast<float>(light[i][c]);
    std::fill(std::begin(records[i].gradient), std::end(records[i].gradient), 0.0f);
    std::fill(std::begin(records[i].rotational), std::end(records[i].rotational), 0.0f);
  }
  return records;
}

bool DeepBake::add_gradients(Records& surface, const std::vector<RgbD>& before) {
  const IrradianceCache reflected(with_light(before), origin_, {}, volume_);
  HitLight light = deep_light(reflected, world_, finest_, request_.threads);
  scattered_ = light.scattered;
  light.reflect = settings_.bounces > 1;
  if (!light.reflect) light.cache = nullptr;  // `before` is all dark then.
  RecordMaker maker(lighting_, effects_, settings_, origin_, request_.threads);
  std::atomic<std::size_t> done = 0;
  parallel_for_slots(request_.threads, surface.size(), 1, [&](std::size_t i, int slot) {
    if (is_stopped()) return;
    SurfaceRecord again = surface[i];
    again.flags = record_flags(kSolvedLayer, again.wave());
    if (!recall(request_.journal, again)) {
      maker.gather(sources_.at(again.key).offset, light, again, slot);
      if (request_.journal) request_.journal->add(again);
    }
    // Where it lies, how far it reaches and what it receives stay.
    std::copy_n(again.gradient, 9, surface[i].gradient);
    std::copy_n(again.rotational, 6, surface[i].rotational);
    surface[i].error = again.error;
    surface[i].media_share = again.media_share;
    if (slot == 0) report(0.7 + 0.2 * double(++done) / double(surface.size()));
  });
  counters_ += maker.counters();
  return !stopped_;
}

void DeepBake::store(const DeepSolution& solution, VolumeRecords& volume) const {
  const std::size_t stride = volume.stride();
  const std::vector<RgbD>& light = solution.light.volume;
  for (std::size_t i = 0; i < volume.size(); ++i) {
    const std::span<VolumeMoment> moments = volume.moments_of(i);
    for (std::size_t k = 0; k < stride; ++k)
      for (int c = 0; c < 3; ++c)
        moments[k].value[c] = static_cast<float>(light[i * stride + k][c]);
    // Phase functions cut short may scatter a little less than nothing to where it is dark.
    for (float& fluence : moments[0].value) fluence = std::max(fluence, 0.0f);
    const double all = luminance(light[i * stride]);
    const double from_surfaces = luminance(solution.reflected_fluence[i]);
    volume.records[i].media_share =
        all > 0 ? static_cast<float>(std::clamp(1 - from_surfaces / all, 0.0, 1.0)) : 0;
  }
}

// What an earlier run found is taken from the journal: whoever stops a bake may not have the time
// that the solve takes.
DeepSolution DeepBake::solve() {
  const VolumeRecords& volume = medium_.records();
  if (request_.journal)
    if (std::optional<DeepSolution> found =
            solution_of(request_.journal->find_note(kKeyOfSolution));
        found && found->light.surface.size() == records_.size() &&
        found->light.volume.size() == volume.moments.size() &&
        found->reflected_fluence.size() == volume.size())
      return std::move(*found);
  std::vector<DeepRow> surface_rows;
  for (const SurfaceRecord& r : records_) surface_rows.push_back(std::move(sources_.at(r.key).row));
  std::vector<DeepRow>& volume_rows = medium_.rows();
  const IrradianceCache places(records_, origin_, {},
                               std::make_shared<VolumeCache>(volume, origin_));
  const LightTransport transport(world_, places, surface_rows, volume_rows, finest_,
                                 request_.threads);
  DeepSolution solution = solve_deep_light(transport, surface_rows, volume_rows, settings_.bounces,
                                           settings_.volume_bounces);
  if (request_.journal) {
    request_.journal->add_note(kKeyOfSolution, bytes_of(solution));
    request_.journal->seal();
  }
  return solution;
}

std::optional<DeepRecords> DeepBake::bake() {
  const auto stopped = [this] { return is_stopped(); };
  const bool has_surfaces = needs_deep_surfaces(world_, settings_, effects_);
  if (has_surfaces && !place_everywhere()) return std::nullopt;
  report(0.6);
  if (effects_.multiple_scattering && !medium_.place(stopped)) return std::nullopt;
  if (has_surfaces && !place_at_uncovered_hits()) return std::nullopt;

  const auto start = std::chrono::steady_clock::now();
  DeepRecords deep;
  VolumeRecords volume = medium_.records();
  const DeepSolution solution = solve();
  deep.stats = {
      .orders = solution.orders,
      .scatterings = solution.scatterings,
      .is_accelerated = solution.is_accelerated,
      .applications = solution.applications,
      .changes = solution.changes,
      .ratio = solution.ratio,
      .truncation_bound = solution.truncation_bound,
      .surface_records = records_.size(),
      .volume_records = volume.size(),
      .strata = solution.strata,
      .seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count()};
  report(0.7);

  deep.surface = with_light(solution.light.surface);
  store(solution, volume);
  deep.volume = volume_ = std::make_shared<VolumeCache>(std::move(volume), origin_);
  if (!add_gradients(deep.surface, solution.before)) return std::nullopt;
  deep.scattered = scattered_;
  deep.counters = maker_.counters();
  deep.counters += medium_.counters();
  deep.counters += counters_;
  return deep;
}

}  // namespace

std::string DeepStats::to_json() const {
  const nlohmann::ordered_json all = {{"orders", orders},
                                      {"changes", changes},
                                      {"ratio", ratio},
                                      {"truncation_bound", truncation_bound},
                                      {"scatterings", scatterings},
                                      {"accelerated", is_accelerated},
                                      {"applications", applications},
                                      {"surface_records", surface_records},
                                      {"volume_records", volume_records},
                                      {"strata", strata}};
  return all.dump();
}

bool needs_deep_surfaces(const World& world, const BakeSettings& settings, const Effects& effects) {
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
  return DeepBake(lighting, settings, effects, request, origin).bake();
}

}  // namespace brume
