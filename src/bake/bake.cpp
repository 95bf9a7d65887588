#include "bake/bake.h"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <optional>
#include <span>
#include <unordered_map>
#include <unordered_set>

#include "bake/deep_bake.h"
#include "bake/placement.h"
#include "bake/record_maker.h"
#include "bake/work_units.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"

namespace brume {
namespace {

// Waves of a view, by stride in points of view_points(): the first are global, the rest stay in
// their cell. They count from where those over all surfaces never get to, so that each can tell how
// far its own kind came.
constexpr int kCoarsestStride = 32 * kPointsPerPixel, kFinestGlobalStride = 8 * kPointsPerPixel;
constexpr int kFirstViewWave = 128;
// Over all surfaces, so many of the last waves stay in their cell; patches are small enough for
// those after at most kMostWaves.
constexpr int kWavesInCells = 3, kMostWaves = 64;
// Rows of a frame whose candidates are looked at together; a multiple of every stride.
constexpr int kBandRows = 64;

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

class Baker {
 public:
  Baker(const Lighting& lighting, const BakeSettings& settings, const BakeRequest& request,
        const IrradianceCache* existing)
      : lighting_(lighting),
        world_(lighting.world()),
        settings_(settings),
        request_(request),
        effects_(plan_effects(world_, settings.bounces, settings.volume_bounces)),
        origin_(existing ? existing->origin() : bake_origin(world_)),
        maker_(lighting, effects_, settings, origin_, request.threads) {
    if (existing != nullptr) {
      for (const SurfaceRecord& r : existing->records()) {
        if ((r.flags & kUnfinishedViewFlag) == 0)
          records_.push_back(r);
        else
          unfinished_.emplace(r.key, r);
      }
      existing_ = existing->size();
      volume_ = existing->volume();
    }
    cache_ = cache_of(records_);
  }

  void bake_deep();
  void bake_top();
  BakeResult finish();

 private:
  using Points = std::vector<SurfacePoint>;
  using Records = std::vector<SurfaceRecord>;

  // Any thread.
  bool is_stopped() {
    if (!stopped_ && request_.stop_requested && request_.stop_requested()) stopped_ = true;
    return stopped_;
  }
  // Records of both kinds until the limit.
  std::size_t room() const {
    const std::size_t held = records_.size() + (volume_ ? volume_->size() : 0);
    return request_.record_limit - std::min(request_.record_limit, held);
  }
  bool has_room_for(std::size_t more) {
    if (more <= room()) return true;
    stopped_ = is_at_limit_ = true;
    return false;
  }
  // With the records of the medium.
  std::shared_ptr<const IrradianceCache> cache_of(Records records) const {
    return std::make_shared<IrradianceCache>(std::move(records), origin_,
                                             std::span<const std::uint32_t>(), volume_);
  }
  int next_wave_everywhere() const;
  // Top records as they were before that wave over all surfaces.
  std::shared_ptr<const IrradianceCache> before_wave(int wave) const;
  void everywhere();
  void views();
  void add_frame(WorkUnits& work, std::uint32_t batch, const BakeView& view, int stride);
  Points uncovered(const Points& points);
  bool covers(const IrradianceCache& cache, const SurfacePoint& p) const;
  SurfacePoint point_of(const Candidate& c) const {
    return {vector(c.position) + origin_, vector(c.normal), c.offset, c.min_radius};
  }
  // What a gather finds at a record, or found before.
  void gather(const SurfacePoint& point, SurfaceRecord& record, int slot);
  // Gathers at all points, clamps and seals them; false where the bake stops first.
  bool bake_wave(const Points& points, int wave);
  void seal(Records fresh);
  void bake_units(WorkUnits& work);
  std::optional<Records> bake_unit(const WorkUnits& work, WorkUnit unit, int slot);
  SurfaceRecord bake_in_unit(const SurfacePoint& p, int wave, const IrradianceCache& own, int slot);
  Records with_unfinished(Records records) const;
  void offer_snapshot();
  void report(const std::string& stage, double fraction) const {
    if (request_.progress) request_.progress(stage, fraction);
  }

  const Lighting& lighting_;
  const World& world_;
  const BakeSettings& settings_;
  const BakeRequest& request_;
  Effects effects_;
  Vec3d origin_;
  Records records_;
  std::size_t existing_ = 0;
  // Of the top layer, by key: cells that a stopped bake, or a shard, finished without the others. A
  // cell's placement knows the global waves and itself alone, so these cover nothing until their
  // cell chooses them again.
  std::unordered_map<std::uint64_t, SurfaceRecord> unfinished_;
  // Of the cells finished in this run; guarded while they are being baked.
  std::vector<Records> finished_units_;
  std::mutex units_mutex_, snapshot_mutex_;
  std::shared_ptr<const IrradianceCache> cache_;
  RecordMaker maker_;
  std::shared_ptr<const VolumeCache> volume_;
  Scattered scattered_;                          // Of volume_, once something asked for it.
  std::shared_ptr<const IrradianceCache> deep_;  // What the gathers of top records see.
  HitLight below_;
  DeepStats deep_stats_;
  std::atomic<bool> stopped_ = false;
  bool is_at_limit_ = false;
  BakeStats stats_;
};

Baker::Points Baker::uncovered(const Points& points) {
  std::vector<std::uint8_t> keep(points.size());
  parallel_for(request_.threads, points.size(), 256,
               [&](std::size_t i) { keep[i] = !covers(*cache_, points[i]); });
  Points left;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (keep[i]) left.push_back(points[i]);
  return left;
}

bool Baker::covers(const IrradianceCache& cache, const SurfacePoint& p) const {
  return cache.covers(pixel_query(world_, p.position, p.normal, p.min_radius), kCoveredWithin);
}

void Baker::gather(const SurfacePoint& p, SurfaceRecord& r, int slot) {
  if (recall(request_.journal, r)) return;
  maker_.gather(p.offset, below_, r, slot);
  if (request_.journal) request_.journal->add(r);
}

bool Baker::bake_wave(const Points& points, int wave) {
  if (is_stopped() || !has_room_for(points.size())) return false;
  Records fresh(points.size());
  parallel_for_slots(request_.threads, points.size(), 1, [&](std::size_t i, int slot) {
    if (is_stopped()) return;
    offer_snapshot();
    fresh[i] = maker_.place(points[i], kTopLayer, wave);
    gather(points[i], fresh[i], slot);
  });
  if (stopped_) return false;
  maker_.clamp_by_neighbours(fresh, kTopLayer, {cache_.get()});
  seal(std::move(fresh));
  return true;
}

void Baker::seal(Records fresh) {
  records_.insert(records_.end(), fresh.begin(), fresh.end());
  std::sort(records_.begin(), records_.end(), RecordOrder());
  // Two views, or a view and a surface candidate, may have chosen the very same point.
  records_.erase(std::unique(records_.begin(), records_.end(),
                             [](const SurfaceRecord& a, const SurfaceRecord& b) {
                               return a.key == b.key && a.layer() == b.layer();
                             }),
                 records_.end());
  cache_ = cache_of(records_);
}

// A wave is sealed whole or not at all, so those up to the last one with records are done.
int Baker::next_wave_everywhere() const {
  int next = 0;
  for (const SurfaceRecord& r : records_)
    if (r.layer() == kTopLayer && r.wave() < kFirstViewWave) next = std::max(next, r.wave() + 1);
  return next;
}

std::shared_ptr<const IrradianceCache> Baker::before_wave(int wave) const {
  Records before;
  for (const SurfaceRecord& r : records_)
    if (r.layer() == kTopLayer && (r.wave() < wave || r.wave() >= kFirstViewWave))
      before.push_back(r);
  return cache_of(std::move(before));
}

// Waves of candidates over all surfaces, each twice as dense as the one before. Goes on after the
// waves that an earlier bake sealed: asked again, those would fill what their thinning left to the
// next. They end in cells, which shards share.
void Baker::everywhere() {
  SurfacePatches patches(world_.tracer());
  const double finest = settings_.min_radius / world_.unit();
  double spacing = finest;
  int waves = 1;
  for (const double largest = patches.largest(); spacing < largest && waves < kMostWaves; ++waves)
    spacing *= 2;
  const int first_in_cells = std::max(0, waves - kWavesInCells);
  const int next = next_wave_everywhere();
  if (next > first_in_cells) return;
  int wave = 0;
  const auto split = [&] {
    const auto before = wave < next ? before_wave(wave) : cache_;
    patches.split(spacing, request_.threads, [&](SurfacePoint p) {
      p.min_radius = finest;
      return covers(*before, p);
    });
  };
  const auto open = [&] {
    Points points = patches.points(spacing, random_key(settings_.seed, wave));
    for (SurfacePoint& p : points) p.min_radius = finest;
    return uncovered(points);
  };
  for (; wave < first_in_cells; ++wave, spacing /= 2) {
    report("gather", 0.3 * wave / waves);
    split();
    if (wave < next) continue;
    if (is_stopped() || !bake_wave(thin(open(), 0.7 * spacing), wave)) return;
  }
  WorkUnits work(origin_, world_.unit());
  for (; wave < waves; ++wave, spacing /= 2) {
    const std::uint32_t batch = work.add_batch({wave, 0.7 * spacing});
    split();
    for (const SurfacePoint& p : open()) work.add(batch, p, finest);
  }
  bake_units(work);
}

void Baker::add_frame(WorkUnits& work, std::uint32_t batch, const BakeView& view, int stride) {
  const int width = kPointsPerPixel * view.width, height = kPointsPerPixel * view.height;
  for (int y = 0; y < height && !is_stopped(); y += kBandRows) {
    const PixelRect band{0, y, width, std::min(y + kBandRows, height)};
    for (const SurfacePoint& p : uncovered(view_points(world_, view, band, stride, true)))
      work.add(batch, p, p.min_radius / kFootprintPixels);
  }
}

void Baker::views() {
  int wave = kFirstViewWave;
  for (int stride = kCoarsestStride; stride >= kFinestGlobalStride; stride /= 2, ++wave)
    for (const BakeView& view : request_.views) {
      const PixelRect frame{0, 0, kPointsPerPixel * view.width, kPointsPerPixel * view.height};
      report("gather", 0.1 * (wave - kFirstViewWave));
      const Points open =
          uncovered(view_points(world_, view, frame, stride, stride < kCoarsestStride));
      if (!bake_wave(open, wave)) return;
    }
  WorkUnits work(origin_, world_.unit());
  for (int stride = kFinestGlobalStride / 2; stride >= 1; stride /= 2, ++wave)
    for (const BakeView& view : request_.views)
      add_frame(work, work.add_batch({wave, 0}), view, stride);
  bake_units(work);
}

// Nothing where the bake stops within the unit. A record counts as soon as it is made, so that
// candidates that lie close together, as those of surfaces seen at a grazing angle do, make no
// clump.
std::optional<Baker::Records> Baker::bake_unit(const WorkUnits& work, WorkUnit unit, int slot) {
  Records all;
  IrradianceCache own({}, origin_);
  for (std::size_t begin = 0; begin < unit.size();) {
    const std::uint32_t index = unit[begin].batch;
    const CandidateBatch& batch = work.batch(index);
    Points points;
    for (; begin < unit.size() && unit[begin].batch == index; ++begin)
      if (const SurfacePoint p = point_of(unit[begin]); !covers(own, p)) points.push_back(p);
    if (batch.thinned_to > 0) points = thin(points, batch.thinned_to);
    for (const SurfacePoint& p : points) {
      if (is_stopped()) return std::nullopt;
      offer_snapshot();
      if (covers(own, p)) continue;
      all.push_back(bake_in_unit(p, batch.wave, own, slot));
      if (stopped_) return std::nullopt;
      std::sort(all.begin(), all.end(), RecordOrder());
      own = IrradianceCache(all, origin_);
    }
  }
  return all;
}

SurfaceRecord Baker::bake_in_unit(const SurfacePoint& p, int wave, const IrradianceCache& own,
                                  int slot) {
  SurfaceRecord r = maker_.place(p, kTopLayer, wave);
  if (const auto it = unfinished_.find(r.key); it != unfinished_.end()) {
    r = it->second;
    r.flags &= ~kUnfinishedViewFlag;
    return r;
  }
  gather(p, r, slot);
  maker_.clamp_by_neighbours({&r, 1}, kTopLayer, {cache_.get(), &own});
  return r;
}

// Units begin in their order, so that those that keep within the record limit are the same ones for
// any number of threads.
void Baker::bake_units(WorkUnits& work) {
  if (is_stopped()) return;
  std::vector<WorkUnit> units;
  std::uint32_t number = 0;
  for (const WorkUnit& unit : work.units())
    if (number++ % request_.shard.count == request_.shard.index) units.push_back(unit);
  finished_units_.assign(units.size(), {});
  std::vector<std::uint8_t> is_finished(units.size());
  std::atomic<std::size_t> next = 0, done = 0, made = 0;
  const std::size_t room = this->room();
  parallel_for_slots(request_.threads, units.size(), 1, [&](std::size_t, int slot) {
    if (made > room) return;
    const std::size_t i = next++;
    std::optional<Records> records = bake_unit(work, units[i], slot);
    if (!records) return;
    made += records->size();
    const double fraction = 0.3 + 0.7 * double(++done) / double(units.size());
    {
      const std::lock_guard lock(units_mutex_);
      finished_units_[i] = std::move(*records);
      is_finished[i] = 1;
    }
    if (slot == 0) report("gather", fraction);
  });
  Records fresh;
  for (std::size_t i = 0; i < units.size(); ++i) {
    if (made > room && fresh.size() + finished_units_[i].size() > room) {
      stopped_ = is_at_limit_ = true;
      break;
    }
    if (!is_finished[i]) continue;
    fresh.insert(fresh.end(), finished_units_[i].begin(), finished_units_[i].end());
  }
  finished_units_.clear();
  const bool is_part = stopped_ || request_.shard.count > 1;
  if (is_part)
    for (SurfaceRecord& r : fresh) r.flags |= kUnfinishedViewFlag;
  seal(std::move(fresh));
  if (is_part) return;
  for (auto& [key, r] : unfinished_) r.flags &= ~kUnfinishedViewFlag;
}

// What no cell chose again belongs to other views, or to cells that have not been reached again.
Baker::Records Baker::with_unfinished(Records records) const {
  std::unordered_set<std::uint64_t> chosen;
  for (const SurfaceRecord& r : records)
    if (r.layer() == kTopLayer) chosen.insert(r.key);
  for (const auto& [key, r] : unfinished_)
    if (!chosen.contains(key)) records.push_back(r);
  return records;
}

void Baker::offer_snapshot() {
  if (!request_.snapshot_requested || !request_.snapshot_requested()) return;
  Records all = records_;
  {
    const std::lock_guard lock(units_mutex_);
    for (const Records& unit : finished_units_)
      for (SurfaceRecord r : unit) {
        r.flags |= kUnfinishedViewFlag;
        all.push_back(r);
      }
  }
  const std::lock_guard lock(snapshot_mutex_);
  request_.snapshot(cache_of(with_unfinished(std::move(all))), deep_stats_);
}

void Baker::bake_deep() {
  const auto start = std::chrono::steady_clock::now();
  if (needs_deep_bake(world_, settings_, cache_.get())) {
    auto deep = bake_deep_records(lighting_, settings_, effects_, request_, origin_);
    if (!deep) {
      stopped_ = true;
    } else if (has_room_for(deep->surface.size() + deep->volume->size())) {
      deep_stats_ = deep->stats;
      stats_.counters += deep->counters;
      volume_ = std::move(deep->volume);
      scattered_ = std::move(deep->scattered);
      seal(std::move(deep->surface));
    }
    stats_.seconds.emplace_back(
        "bounces", std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
}

void Baker::bake_top() {
  if (!effects_.indirect || is_stopped()) return;
  const auto start = std::chrono::steady_clock::now();
  deep_ = cache_;
  below_ = light_below(*deep_, settings_, world_, request_.threads, scattered_);
  scattered_ = below_.scattered;
  if (request_.everywhere)
    everywhere();
  else
    views();
  report("gather", 1);
  stats_.seconds.emplace_back(
      "gather", std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
}

BakeResult Baker::finish() {
  if (!unfinished_.empty()) {
    Records all = with_unfinished(std::move(records_));
    records_.clear();
    seal(std::move(all));
  }
  stats_.counters += maker_.counters();
  stats_.records_added = cache_->size() - existing_;
  return {cache_, std::move(scattered_), std::move(stats_), deep_stats_, stopped_, is_at_limit_};
}

void check(const BakeSettings& s) {
  if (s.bounces < 0 || s.bounces > kMaxBounces)
    throw Error(ErrorKind::InvalidInput, "--bounces: " + std::to_string(s.bounces) +
                                             " is outside 0.." + std::to_string(kMaxBounces));
}

}  // namespace

BakeResult bake(const Lighting& lighting, const BakeSettings& settings, const BakeRequest& request,
                const IrradianceCache* existing) {
  check(settings);
  Baker baker(lighting, settings, request, existing);
  baker.bake_deep();
  if (!request.deep_only) baker.bake_top();
  return baker.finish();
}

bool needs_deep_bake(const World& world, const BakeSettings& settings,
                     const IrradianceCache* existing) {
  const Effects effects = plan_effects(world, settings.bounces, settings.volume_bounces);
  const bool has_surfaces = existing != nullptr && !existing->records().empty() &&
                            existing->records().front().layer() == kDeepLayer;
  const bool has_medium = existing != nullptr && existing->volume()->size() > 0;
  return (needs_deep_surfaces(world, settings, effects) && !has_surfaces) ||
         (effects.multiple_scattering && !has_medium);
}

}  // namespace brume
