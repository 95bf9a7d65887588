#include "bake/deep_bake.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <numeric>
#include <unordered_map>

#include "bake/light_solve.h"
#include "bake/placement.h"
#include "bake/record_maker.h"
#include "bake/volume_placement.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/sampling.h"
#include "gather/surface_light.h"

namespace brume {
namespace {

// Fewer cells each way: what deep records find is averaged by all that see them.
constexpr double kCellsDivisor = 2.5;
// Records are first placed so many footprints apart, half as many in each wave that follows: most
// reach farther than the footprint that asked for them.
constexpr double kFirstSpacing = 8;
// Hits that are asked about more finely than this part of the median first hit are not worth a
// record: what goes on in a crack matters little to what lies outside.
constexpr double kFinestPart = 1.0 / 4;
// Placement ends where open hits weigh so little of what all hits weigh, or hardly less than a wave
// before: there, the nearest records in sight answer from farther away. Light in a clutter of small
// things reaches few others, and would take most records (docs/decisions/0010, 0012).
constexpr double kOpenPart = 0.02, kLeastProgress = 0.8;
// In finest footprints: what is wider weighs as wide as that, or far ground would weigh more than
// all else.
constexpr double kWidestPart = 32;
constexpr std::size_t kMostRecords = 40000, kLeastWave = 1000;
constexpr int kLampRays = 256, kMostLamps = 64, kLampSamples = 8;
// Of a stratum, that stand for the medium along it. A row has hundreds of strata, so that more
// change nothing, but a little where directions matter (docs/decisions/0009).
constexpr int kMediumPoints = 1, kMediumPointsOfLobes = 2;
// In a journal, deep records as their second gathers found them.
constexpr int kSolvedLayer = 2;
constexpr std::uint64_t kKeyOfSolution = 0x736f6c7574696f6eULL;  // And the solve's note.

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

double weight_of(const std::vector<SurfacePoint>& points) {
  return std::accumulate(points.begin(), points.end(), 0.0,
                         [](double sum, const SurfacePoint& p) { return sum + p.weight; });
}

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
        maker_(lighting, effects, first_settings_, origin, request.threads),
        medium_(lighting, first_settings_, effects, origin, request.threads, request.journal),
        cache_({}, origin) {}

  std::optional<DeepRecords> bake();

 private:
  using Records = std::vector<SurfaceRecord>;
  using Points = std::vector<SurfacePoint>;

  bool is_stopped() {
    if (!stopped_ && request_.stop_requested && request_.stop_requested()) stopped_ = true;
    return stopped_;
  }
  void report(double fraction) const {
    if (request_.progress) request_.progress("bounces", fraction);
  }
  Points uncovered(const Points& points) const;
  // Where light first lands, and other places that surfaces see.
  struct FirstPoints {
    Points lit, dark;
  };
  FirstPoints first_points() const;
  // Until nearly all hits of all gathers are covered.
  bool place();
  bool bake_wave(const Points& points);
  // What an earlier run's first gather found at a record that is placed.
  bool find_first(SurfaceRecord& record, DeepRow& row) const;
  // What a hit of that width weighs. Nothing is finest where only the medium sees surfaces.
  double weight_of_width(double width) const {
    const double capped = finest_ > 0 ? std::min(width, kWidestPart * finest_) : width;
    return capped * capped;
  }
  // What the hits of records weigh, against others as wide: those whose own light, of first order,
  // is less than the median matter as much less.
  std::vector<double> shares_of_light() const;
  // Hits of the reflecting strata of a gather at `receiver`, whose weights are times `share`.
  Points hits(const Vec3d& receiver, const DeepRow& row, double share) const;
  // With positions and offsets as their surface has them.
  Points on_surfaces(Points points) const;
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
  double finest_ = 0;  // Of footprints.
  RecordMaker maker_;
  VolumePlacement medium_;
  IrradianceCache cache_;  // Of records_, whose light is of their first gathers.
  Records records_;
  std::unordered_map<std::uint64_t, DeepRow> rows_;  // By key.
  std::shared_ptr<const VolumeCache> volume_;        // What the solve found,
  std::shared_ptr<const IncidentField> scattered_;   // and as gathers ask for it.
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

bool DeepBake::bake_wave(const Points& points) {
  Records fresh(points.size());
  std::vector<DeepRow> rows(points.size());
  HitLight lamps;
  lamps.reflect = settings_.bounces > 1;
  parallel_for_slots(request_.threads, points.size(), 1, [&](std::size_t i, int slot) {
    if (is_stopped()) return;
    fresh[i] = maker_.place(points[i], kDeepLayer, wave_);
    if (find_first(fresh[i], rows[i])) return;
    const GatherResult g = maker_.gather(points[i].offset, lamps, fresh[i], slot);
    rows[i] = {{g.irradiance_media + g.irradiance_emitted},
               {g.irradiance_surface - g.irradiance_emitted},
               maker_.strata(slot)};
    if (request_.journal) request_.journal->add(fresh[i], bytes_of(rows[i]));
  });
  if (stopped_) return false;
  maker_.clamp_by_neighbours(fresh, kDeepLayer, {&cache_});
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    rows[i].footprint = points[i].min_radius;
    rows[i].offset = points[i].offset;
    // Two hits may be the very same point.
    if (rows_.emplace(fresh[i].key, std::move(rows[i])).second) records_.push_back(fresh[i]);
  }
  std::sort(records_.begin(), records_.end(), RecordOrder());
  cache_ = IrradianceCache(records_, origin_);
  wave_ = std::min(wave_ + 1, 255);
  return true;
}

DeepBake::Points DeepBake::uncovered(const Points& points) const {
  std::vector<std::uint8_t> is_open(points.size());
  parallel_for(request_.threads, points.size(), 64, [&](std::size_t i) {
    const SurfacePoint& p = points[i];
    is_open[i] = !cache_.covers({kDeepLayer, p.position, p.normal, p.min_radius, &world_.tracer()},
                                kCoveredWithin);
  });
  Points open;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (is_open[i]) open.push_back(points[i]);
  return open;
}

DeepBake::FirstPoints DeepBake::first_points() const {
  FirstPoints points;
  // Where no lamp's light lands, only light that no lamp sends could begin.
  const bool is_lit_otherwise =
      effects_.scattering || effects_.emission || world_.has_gathered_emitters();
  const auto add_hit = [&](const Ray& ray, double spread, std::uint64_t key) {
    const Hit hit = world_.tracer().intersect(ray);
    if (!hit.is_hit() || !world_.material(hit).reflects()) return;
    const Vec3d n = reflecting_normal(hit, ray.direction);
    Counters ignored;
    const bool is_lit =
        is_lit_otherwise || !is_black(direct_irradiance(lighting_, hit.position + n * hit.offset, n,
                                                        kLampSamples, key, ignored));
    (is_lit ? points.lit : points.dark).push_back({hit.position, n, hit.offset, spread * hit.t});
  };
  const std::uint64_t key = random_key(settings_.seed, 0x6669727374ULL);
  // Lamps of which there are many stand for each other.
  std::vector<const Light*> lamps;
  for (const auto& light : world_.lights())
    if (light->kind() != Light::Kind::Directional && light->kind() != Light::Kind::Environment)
      lamps.push_back(light.get());
  const std::size_t step = lamps.size() / kMostLamps + 1;
  for (std::size_t l = 0; l < lamps.size(); l += step)
    for (int i = 0; i < kLampRays; ++i) {
      RandomStream random(random_key(key, l, i));
      const Vec2d u = random.uniform2();
      add_hit({lamps[l]->centre(), sample_sphere({(i + u.x) / kLampRays, u.y})},
              std::sqrt(kPi / kLampRays), random.bits());
    }
  const double spread = 0.5 * std::sqrt(kPi / settings_.gather.cell_count());
  std::uint64_t i = 0;
  for (const SurfacePoint& p : some_surface_points(world_.tracer(), key)) {
    RandomStream random(random_key(key, i++));
    const Vec3d up = sample_cosine_hemisphere(random.uniform2());
    add_hit({p.position + p.normal * p.offset, Frame(p.normal).to_world(up)}, spread,
            random.bits());
  }
  return points;
}

DeepBake::Points DeepBake::hits(const Vec3d& receiver, const DeepRow& row, double share) const {
  Points points;
  for (const Stratum& s : row.strata.strata) {
    if (!s.reflects()) continue;
    const double width = std::max(row.footprint_at(s), finest_);
    points.push_back({receiver + s.way() * double(s.distance), vector(s.normal), 0, width,
                      share * weight_of_width(width)});
  }
  return points;
}

DeepBake::Points DeepBake::on_surfaces(Points points) const {
  parallel_for(request_.threads, points.size(), 64, [&](std::size_t i) {
    SurfacePoint& p = points[i];
    p.offset = world_.tracer().offset_at(p.position);
    const double above = 4 * p.offset;
    const Hit hit =
        world_.tracer().intersect({p.position + p.normal * above, -p.normal}, 2 * above);
    if (!hit.is_hit()) return;
    p.position = hit.position;
    p.offset = hit.offset;
  });
  return points;
}

std::vector<double> DeepBake::shares_of_light() const {
  std::vector<double> shares;
  for (const SurfaceRecord& r : records_) {
    const DeepRow& row = rows_.at(r.key);
    shares.push_back(luminance(row.unreflected[0] + row.reflected[0]));
  }
  if (shares.empty()) return shares;
  std::vector<double> sorted = shares;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  for (double& share : shares) share = *middle > 0 ? std::min(1.0, share / *middle) : 1;
  return shares;
}

bool DeepBake::place() {
  FirstPoints first = first_points();
  Points open = std::move(first.lit);
  std::vector<double> footprints;
  for (const SurfacePoint& p : open) footprints.push_back(p.min_radius);
  if (!footprints.empty()) {
    const auto middle = footprints.begin() + static_cast<std::ptrdiff_t>(footprints.size() / 2);
    std::nth_element(footprints.begin(), middle, footprints.end());
    finest_ = *middle * kFinestPart;
  }
  for (SurfacePoint& p : open) {
    p.min_radius = std::max(p.min_radius, finest_);
    p.weight = weight_of_width(p.min_radius);
  }
  double asked = 0;  // What all hits weigh so far.
  for (std::size_t i = 0; i < medium_.rows().size(); ++i) {
    const Points seen = hits(vector(medium_.records().records[i].position) + origin_,
                             medium_.rows()[i], medium_.share(i));
    asked += weight_of(seen);
    open.insert(open.end(), seen.begin(), seen.end());
  }
  double last_part = kInfinity;
  for (double spacing = kFirstSpacing;; spacing = std::max(1.0, spacing / 2)) {
    open = uncovered(open);
    const double weight = weight_of(open), part = asked > 0 ? weight / asked : 1;
    if (weight == 0 || part <= kOpenPart || records_.size() >= kMostRecords) break;
    if (spacing == 1 && part > kLeastProgress * last_part) break;
    last_part = part;
    report(0.6 * std::min(1.0, kOpenPart / part));
    Points points = thin_by_footprint(
        open, 0.7 * spacing,
        std::min(kMostRecords - records_.size(), std::max(kLeastWave, records_.size() / 2)));
    const std::size_t before = records_.size();
    if (is_stopped() || !bake_wave(on_surfaces(std::move(points)))) return false;
    if (records_.size() == before) break;
    const std::vector<double> shares = shares_of_light();
    for (std::size_t i = 0; i < records_.size(); ++i) {
      const SurfaceRecord& r = records_[i];
      if (r.wave() != std::min(wave_ - 1, 255)) continue;
      const DeepRow& row = rows_.at(r.key);
      const Points all =
          hits(vector(r.position) + origin_ + vector(r.normal) * row.offset, row, shares[i]);
      asked += weight_of(all);
      const Points seen = uncovered(all);
      open.insert(open.end(), seen.begin(), seen.end());
    }
  }
  // Where light never came to, a few say so: gathers there need not look for others far and wide.
  for (SurfacePoint& p : first.dark) p.min_radius = std::max(p.min_radius, finest_);
  const Points dark = uncovered(first.dark);
  return bake_wave(on_surfaces(thin_by_footprint(dark, 0.7 * kFirstSpacing, dark.size())));
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
  HitLight light = deep_light(reflected, world_, request_.threads);
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
      maker.gather(rows_.at(again.key).offset, light, again, slot);
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
  // Leaves their offsets, which second gathers need.
  for (const SurfaceRecord& r : records_) surface_rows.push_back(std::move(rows_.at(r.key)));
  std::vector<DeepRow>& volume_rows = medium_.rows();
  const IrradianceCache places(records_, origin_, {},
                               std::make_shared<VolumeCache>(volume, origin_));
  const LightTransport transport(world_, places, surface_rows, volume_rows, request_.threads);
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
  if (effects_.multiple_scattering && !medium_.place(stopped)) return std::nullopt;
  if (has_surfaces && !place()) return std::nullopt;
  report(0.6);

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
  deep.gather.cells_theta =
      std::max(4, static_cast<int>(settings.gather.cells_theta / kCellsDivisor));
  deep.gather.cells_phi = std::max(8, static_cast<int>(settings.gather.cells_phi / kCellsDivisor));
  return deep;
}

std::optional<DeepRecords> bake_deep_records(const Lighting& lighting, const BakeSettings& settings,
                                             const Effects& effects, const BakeRequest& request,
                                             const Vec3d& origin) {
  return DeepBake(lighting, settings, effects, request, origin).bake();
}

}  // namespace brume
