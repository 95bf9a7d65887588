#include "bake/bake.h"

#include <algorithm>
#include <chrono>
#include <mutex>
#include <optional>
#include <span>
#include <unordered_map>
#include <unordered_set>

#include "bake/placement.h"
#include "bake/record_maker.h"
#include "bake/work_units.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"

namespace brume {
namespace {

// A layer that changes the mean irradiance by less than this stands for all above it.
constexpr double kConverged = 2e-3;
// Candidates count as covered a little inside a record's edge, where its weight is not yet 0.
constexpr double kCoveredWithin = 0.8;
// Waves of a view, by pixel stride: the first are global, the rest stay in their cell. They count
// from where those over all surfaces never get to, so that each can tell how far its own kind came.
constexpr int kCoarsestStride = 32, kFinestGlobalStride = 8;
constexpr int kFirstViewWave = 128;
// Over all surfaces, so many of the last waves stay in their cell.
constexpr int kWavesInCells = 3;
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
        maker_(lighting, effects_, settings, origin_, request.threads, request.journal) {
    if (existing != nullptr) {
      for (const SurfaceRecord& r : existing->records()) {
        if ((r.flags & kUnfinishedViewFlag) == 0)
          records_.push_back(r);
        else
          unfinished_.emplace(r.key, r);
      }
      existing_ = existing->records().size();
    }
    cache_ = std::make_shared<IrradianceCache>(records_, origin_);
  }

  void bake_deeper();
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
  bool has_room_for(std::size_t more) {
    if (more <= request_.record_limit && records_.size() <= request_.record_limit - more)
      return true;
    stopped_ = is_at_limit_ = true;
    return false;
  }
  bool has_records_above(int layer) const {
    return !records_.empty() && records_.back().layer() > layer;
  }
  int next_wave_everywhere(int layer) const;
  void everywhere(int layer, const std::string& stage);
  void views(int layer);
  void add_frame(WorkUnits& work, std::uint32_t batch, const BakeView& view, int stride, int layer);
  Points uncovered(const Points& points, int layer);
  bool covers(const IrradianceCache& cache, const Candidate& c, int layer) const;
  // Gathers at all points, clamps and seals them; false where the bake stops first.
  bool bake_wave(const Points& points, int layer, int wave);
  void seal(Records fresh);
  void bake_units(WorkUnits& work, int layer);
  std::optional<Records> bake_unit(const WorkUnits& work, WorkUnit unit, int layer, int slot);
  Records bake_batch(std::span<const Candidate> open, int layer, const CandidateBatch& batch,
                     const IrradianceCache& own, int slot);
  Records with_unfinished(Records records) const;
  void offer_snapshot();
  double change_of(int layer) const;
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
  double truncation_bound_ = 0;
  int layers_ = 0;
  std::atomic<bool> stopped_ = false;
  bool is_at_limit_ = false;
  BakeStats stats_;
};

Baker::Points Baker::uncovered(const Points& points, int layer) {
  std::vector<std::uint8_t> keep(points.size());
  parallel_for(request_.threads, points.size(), 256, [&](std::size_t i) {
    const IrradianceQuery query{layer, points[i].position, points[i].normal, points[i].min_radius};
    keep[i] = !cache_->covers(query, kCoveredWithin);
  });
  Points left;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (keep[i]) left.push_back(points[i]);
  return left;
}

bool Baker::covers(const IrradianceCache& cache, const Candidate& c, int layer) const {
  return cache.covers({layer, vector(c.position) + origin_, vector(c.normal), c.min_radius},
                      kCoveredWithin);
}

bool Baker::bake_wave(const Points& points, int layer, int wave) {
  if (is_stopped() || !has_room_for(points.size())) return false;
  Records fresh(points.size());
  parallel_for_slots(request_.threads, points.size(), 1, [&](std::size_t i, int slot) {
    if (is_stopped()) return;
    offer_snapshot();
    fresh[i] = maker_.place(points[i], layer, wave);
    maker_.gather(points[i].offset, fresh[i], slot);
  });
  if (stopped_) return false;
  maker_.clamp_by_neighbours(fresh, layer, {cache_.get()});
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
  cache_ = std::make_shared<IrradianceCache>(records_, origin_);
}

// A wave is sealed whole or not at all, so those up to the last one with records are done.
int Baker::next_wave_everywhere(int layer) const {
  int next = 0;
  for (const SurfaceRecord& r : records_)
    if (r.layer() == layer && r.wave() < kFirstViewWave) next = std::max(next, r.wave() + 1);
  return next;
}

// Waves of candidates over all surfaces, each twice as dense as the one before. Goes on after the
// waves that an earlier bake sealed: asked again, those would fill what their thinning left to the
// next. Those of the top layer end in cells, as it is the one that shards share.
void Baker::everywhere(int layer, const std::string& stage) {
  maker_.use_layer(layer, cache_);
  const SurfacePoints surfaces(world_.tracer());
  const double coarsest = maker_.layer_settings().max_radius * world_.diagonal();
  const double finest = maker_.layer_settings().min_radius * world_.diagonal();
  const int waves = std::min(
      kFirstViewWave, static_cast<int>(std::ceil(std::log2(std::max(1.0, coarsest / finest)))) + 2);
  const int first_in_cells =
      layer == top_layer(settings_) ? std::max(0, waves - kWavesInCells) : waves;
  int wave = next_wave_everywhere(layer);
  if (wave > first_in_cells) return;
  const auto open = [&] {
    report(stage, double(wave) / waves);
    return uncovered(surfaces.points(std::ldexp(coarsest, -wave), random_key(settings_.seed, wave)),
                     layer);
  };
  const auto distance = [&] { return 0.7 * std::max(std::ldexp(coarsest, -wave), finest); };
  for (; wave < first_in_cells; ++wave)
    if (is_stopped() || !bake_wave(thin(open(), distance()), layer, wave)) return;
  if (layer != top_layer(settings_)) return;
  WorkUnits work(origin_);
  for (; wave < waves; ++wave) {
    const std::uint32_t batch = work.add_batch({wave, distance()});
    for (const SurfacePoint& p : open()) work.add(batch, p, finest);
  }
  bake_units(work, layer);
}

void Baker::add_frame(WorkUnits& work, std::uint32_t batch, const BakeView& view, int stride,
                      int layer) {
  for (int y = 0; y < view.height && !is_stopped(); y += kBandRows) {
    const PixelRect band{0, y, view.width, std::min(y + kBandRows, view.height)};
    for (const SurfacePoint& p : uncovered(view_points(world_, view, band, stride, true), layer))
      work.add(batch, p, p.min_radius / kFootprintPixels);
  }
}

void Baker::views(int layer) {
  maker_.use_layer(layer, cache_);
  int wave = kFirstViewWave;
  for (int stride = kCoarsestStride; stride >= kFinestGlobalStride; stride /= 2, ++wave)
    for (const BakeView& view : request_.views) {
      const PixelRect frame{0, 0, view.width, view.height};
      report("gather", 0.1 * (wave - kFirstViewWave));
      const Points open =
          uncovered(view_points(world_, view, frame, stride, stride < kCoarsestStride), layer);
      if (!bake_wave(open, layer, wave)) return;
    }
  WorkUnits work(origin_);
  for (int stride = kFinestGlobalStride / 2; stride >= 1; stride /= 2, ++wave)
    for (const BakeView& view : request_.views)
      add_frame(work, work.add_batch({wave, 0}), view, stride, layer);
  bake_units(work, layer);
}

// Nothing unless the bake stops within the unit.
std::optional<Baker::Records> Baker::bake_unit(const WorkUnits& work, WorkUnit unit, int layer,
                                               int slot) {
  Records all;
  IrradianceCache own({}, origin_);
  for (std::size_t begin = 0; begin < unit.size();) {
    const std::uint32_t batch = unit[begin].batch;
    std::vector<Candidate> open;
    for (; begin < unit.size() && unit[begin].batch == batch; ++begin)
      if (!covers(own, unit[begin], layer)) open.push_back(unit[begin]);
    if (open.empty()) continue;
    const Records fresh = bake_batch(open, layer, work.batch(batch), own, slot);
    if (stopped_) return std::nullopt;
    all.insert(all.end(), fresh.begin(), fresh.end());
    std::sort(all.begin(), all.end(), RecordOrder());
    own = IrradianceCache(all, origin_);
  }
  return all;
}

Baker::Records Baker::bake_batch(std::span<const Candidate> open, int layer,
                                 const CandidateBatch& batch, const IrradianceCache& own,
                                 int slot) {
  Points points;
  for (const Candidate& c : open)
    points.push_back({vector(c.position) + origin_, vector(c.normal), c.offset, c.min_radius});
  if (batch.thinned_to > 0) points = thin(points, batch.thinned_to);
  Records fresh, found;
  for (const SurfacePoint& p : points) {
    if (is_stopped()) return {};
    offer_snapshot();
    SurfaceRecord r = maker_.place(p, layer, batch.wave);
    if (const auto it = unfinished_.find(r.key); it != unfinished_.end()) {
      found.push_back(it->second);
      found.back().flags &= ~kUnfinishedViewFlag;
      continue;
    }
    maker_.gather(p.offset, r, slot);
    fresh.push_back(r);
  }
  maker_.clamp_by_neighbours(fresh, layer, {cache_.get(), &own});
  fresh.insert(fresh.end(), found.begin(), found.end());
  return fresh;
}

// Units begin in their order, so that those that keep within the record limit are the same ones for
// any number of threads.
void Baker::bake_units(WorkUnits& work, int layer) {
  if (is_stopped()) return;
  std::vector<WorkUnit> units;
  std::uint32_t number = 0;
  for (const WorkUnit& unit : work.units())
    if (number++ % request_.shard.count == request_.shard.index) units.push_back(unit);
  finished_units_.assign(units.size(), {});
  std::vector<std::uint8_t> is_finished(units.size());
  std::atomic<std::size_t> next = 0, done = 0, made = 0;
  const std::size_t room =
      records_.size() < request_.record_limit ? request_.record_limit - records_.size() : 0;
  parallel_for_slots(request_.threads, units.size(), 1, [&](std::size_t, int slot) {
    if (made > room) return;
    const std::size_t i = next++;
    std::optional<Records> records = bake_unit(work, units[i], layer, slot);
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
    if (r.layer() == top_layer(settings_)) chosen.insert(r.key);
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
  request_.snapshot(std::make_shared<IrradianceCache>(with_unfinished(std::move(all)), origin_));
}

// Mean change from the layer below to `layer`, at the records of `layer`, relative to its mean.
double Baker::change_of(int layer) const {
  double change = 0, sum = 0;
  for (const SurfaceRecord& r : records_) {
    if (r.layer() != layer) continue;
    const Vec3d p = vector(r.position) + origin_, n = vector(r.normal);
    const double here = luminance(Rgb(r.irradiance[0], r.irradiance[1], r.irradiance[2]));
    const InterpolatedIrradiance below = cache_->irradiance({layer - 1, p, n, 0});
    if (below.records == 0) continue;
    change += here - luminance(below.irradiance);
    sum += here;
  }
  return sum > 0 ? std::abs(change) / sum : 0;
}

void Baker::bake_deeper() {
  if (!effects_.indirect) return;
  const auto start = std::chrono::steady_clock::now();
  const bool has_base = effects_.scattering || effects_.emission || world_.has_gathered_emitters();
  double last_change = 1;
  for (int layer = has_base ? 0 : 1; layer < top_layer(settings_) && !is_stopped(); ++layer) {
    // Deepest first, each sealed before the next begins.
    if (!has_records_above(layer)) everywhere(layer, "bounce " + std::to_string(layer));
    ++layers_;
    if (layer < (has_base ? 1 : 2)) continue;
    const double change = change_of(layer);
    if (change < kConverged) {
      // Successive layers change by an ever smaller amount; the ratio seen last bounds what is
      // left.
      const double ratio = std::min(0.99, last_change > 0 ? change / last_change : 0);
      if (layer + 1 < top_layer(settings_)) truncation_bound_ = change * ratio / (1 - ratio);
      break;
    }
    last_change = change;
  }
  stats_.seconds.emplace_back(
      "bounces", std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
}

void Baker::bake_top() {
  if (!effects_.indirect || is_stopped()) return;
  const auto start = std::chrono::steady_clock::now();
  if (request_.everywhere)
    everywhere(top_layer(settings_), "gather");
  else
    views(top_layer(settings_));
  ++layers_;
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
  stats_.counters = maker_.counters();
  stats_.records_added = records_.size() - existing_;
  return {cache_, std::move(stats_), truncation_bound_, layers_, stopped_, is_at_limit_};
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
  baker.bake_deeper();
  baker.bake_top();
  return baker.finish();
}

BakeResult bake_deeper_layers(const Lighting& lighting, const BakeSettings& settings,
                              const BakeRequest& request, const IrradianceCache* existing) {
  check(settings);
  Baker baker(lighting, settings, request, existing);
  baker.bake_deeper();
  return baker.finish();
}

}  // namespace brume
