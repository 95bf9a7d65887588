#include "bake/bake.h"

#include <algorithm>
#include <chrono>
#include <cstring>
#include <unordered_map>

#include "bake/placement.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"

namespace brume {
namespace {

// Deeper layers are seen only through another gather, which averages them: half the cells each way,
// twice the spacing, and no small radii.
constexpr int kDeeperCellsDivisor = 2;
constexpr double kDeeperErrorFactor = 2, kDeeperMinRadiusFactor = 8;
// A layer that changes the mean irradiance by less than this stands for all above it.
constexpr double kConverged = 2e-3;
// Candidates count as covered a little inside a record's edge, where its weight is not yet 0.
constexpr double kCoveredWithin = 0.8;
// Waves of a view, by pixel stride: the first are global, the rest stay in their tile. They count
// from where those over all surfaces never get to, so that each can tell how far its own kind came.
constexpr int kCoarsestStride = 32, kFinestGlobalStride = 8, kTilePixels = 64;
constexpr int kFirstViewWave = 128;

struct Worker {
  std::unique_ptr<Gatherer> gatherer;
  Counters counters;
};

class Baker {
 public:
  Baker(const Lighting& lighting, const BakeSettings& settings, const BakeRequest& request,
        const IrradianceCache* existing)
      : lighting_(lighting),
        world_(lighting.world()),
        settings_(settings),
        request_(request),
        effects_(plan_effects(world_, settings.bounces, settings.volume_bounces)),
        origin_((world_.bounds().min + world_.bounds().max) * 0.5) {
    for (int a = 0; a < 3; ++a)
      if (!std::isfinite(origin_[a])) origin_[a] = 0;
    if (existing != nullptr) {
      for (const SurfaceRecord& r : existing->records()) {
        if ((r.flags & kUnfinishedViewFlag) == 0)
          records_.push_back(r);
        else
          unfinished_.emplace(r.key, r);
      }
      origin_ = existing->origin();
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

  bool is_stopped() {
    stopped_ = stopped_ || (request_.stop_requested && request_.stop_requested());
    return stopped_;
  }
  void use_layer(int layer);
  bool has_records_above(int layer) const {
    return !records_.empty() && records_.back().layer() > layer;
  }
  int next_wave_everywhere(int layer) const;
  void everywhere(int layer, const std::string& stage);
  void views(int layer);
  Points uncovered(const Points& points, int layer, const IrradianceCache* more);
  SurfaceRecord placed(const SurfacePoint& point, int layer, int wave) const;
  void gather(const SurfacePoint& point, SurfaceRecord& r, Worker& worker) const;
  Records gather_all(const Points& points, int layer, int wave);
  void clamp_by_neighbours(Records& fresh, int layer, const IrradianceCache* more) const;
  void seal(Records fresh);
  Records bake_tile(const BakeView& view, const PixelRect& tile, int layer, int first_wave,
                    Worker& worker);
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
  // Of the top layer, by key: tiles of views that a stopped bake left unfinished. A tile's
  // placement knows its view's global waves and itself alone, so these cover nothing until their
  // tile chooses them again.
  std::unordered_map<std::uint64_t, SurfaceRecord> unfinished_;
  std::shared_ptr<IrradianceCache> cache_;
  std::vector<Worker> workers_;
  HitLight below_;
  BakeSettings layer_settings_;  // As the layer uses them.
  double truncation_bound_ = 0;
  int layers_ = 0;
  bool stopped_ = false;
  BakeStats stats_;
};

// Gatherers for one layer: its options, and the sealed layer that its hits read.
void Baker::use_layer(int layer) {
  layer_settings_ = settings_;
  if (layer < top_layer(settings_)) {
    GatherOptions& g = layer_settings_.gather;
    g.cells_theta = std::max(4, g.cells_theta / kDeeperCellsDivisor);
    g.cells_phi = std::max(8, g.cells_phi / kDeeperCellsDivisor);
    layer_settings_.error *= kDeeperErrorFactor;
    layer_settings_.min_radius =
        std::min(layer_settings_.max_radius, layer_settings_.min_radius * kDeeperMinRadiusFactor);
  }
  const std::size_t slots = static_cast<std::size_t>(resolve_thread_count(request_.threads));
  workers_.resize(slots);
  for (Worker& w : workers_)
    w.gatherer = std::make_unique<Gatherer>(lighting_, effects_, layer_settings_.gather);
  below_ = light_below(*cache_, layer);
}

Baker::Points Baker::uncovered(const Points& points, int layer, const IrradianceCache* more) {
  std::vector<std::uint8_t> keep(points.size());
  parallel_for(request_.threads, points.size(), 256, [&](std::size_t i) {
    const IrradianceQuery query{layer, points[i].position, points[i].normal, points[i].min_radius};
    keep[i] = !cache_->covers(query, kCoveredWithin) &&
              !(more != nullptr && more->covers(query, kCoveredWithin));
  });
  Points left;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (keep[i]) left.push_back(points[i]);
  return left;
}

// A record that knows where it is, and its key.
SurfaceRecord Baker::placed(const SurfacePoint& point, int layer, int wave) const {
  SurfaceRecord r{};
  const Vec3d local = point.position - origin_;
  for (int a = 0; a < 3; ++a) {
    r.position[a] = static_cast<float>(local[a]);
    r.normal[a] = static_cast<float>(point.normal[a]);
  }
  std::uint32_t bits[6];
  std::memcpy(bits, r.position, sizeof r.position);
  std::memcpy(bits + 3, r.normal, sizeof r.normal);
  // Without the layer: layers that choose the same point share its random numbers, so that what
  // changes from one to the next is light, not noise.
  r.key = random_key(bits[0], bits[1], bits[2], bits[3], bits[4], bits[5]);
  r.flags = record_flags(layer, wave);
  return r;
}

// The rest of a record that is placed.
void Baker::gather(const SurfacePoint& point, SurfaceRecord& r, Worker& worker) const {
  // The point as stored, so that the record is a function of what is in the file.
  const Vec3d normal = Vec3d(r.normal[0], r.normal[1], r.normal[2]).normalized();
  const GatherPoint at{Vec3d(r.position[0], r.position[1], r.position[2]) + origin_, normal,
                       point.offset, random_key(settings_.seed, r.key)};
  const GatherResult g = worker.gatherer->gather(at, below_, worker.counters);
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
  const double radius = split_sphere_radius(g, normal, layer_settings_, world_.diagonal());
  r.radius[0] = r.radius[1] = static_cast<float>(radius);
  r.error = static_cast<float>(g.error);
  const double all = luminance(g.irradiance);
  r.media_share = all > 0 ? static_cast<float>(luminance(g.irradiance_media) / all) : 0;
}

Baker::Records Baker::gather_all(const Points& points, int layer, int wave) {
  Records fresh(points.size());
  parallel_for_slots(request_.threads, points.size(), 1, [&](std::size_t i, int slot) {
    fresh[i] = placed(points[i], layer, wave);
    gather(points[i], fresh[i], workers_[slot]);
  });
  return fresh;
}

// A record close to another with a small radius must not reach far past it: R_i <= R_j + |x_i -
// x_j| (neighbour clamping, Krivanek et al. 2006). Reads radii as gathered, so order plays no part.
void Baker::clamp_by_neighbours(Records& fresh, int layer, const IrradianceCache* more) const {
  if (fresh.empty()) return;
  Records sorted = fresh;
  std::sort(sorted.begin(), sorted.end(), RecordOrder());
  const IrradianceCache peers(std::move(sorted), origin_);
  parallel_for(request_.threads, fresh.size(), 64, [&](std::size_t i) {
    SurfaceRecord& r = fresh[i];
    const Vec3d p = Vec3d(r.position[0], r.position[1], r.position[2]) + origin_;
    const Vec3d n(r.normal[0], r.normal[1], r.normal[2]);
    const double own = r.radius[0];
    double radius = own;
    for (const IrradianceCache* others :
         std::initializer_list<const IrradianceCache*>{cache_.get(), &peers, more}) {
      if (others == nullptr) continue;
      for (const RecordWeight& w : others->explain({layer, p, n, own})) {
        const SurfaceRecord& o = *w.record;
        const double d =
            (Vec3d(o.position[0], o.position[1], o.position[2]) + origin_ - p).length();
        radius = std::min(radius, std::min(o.radius[0], o.radius[1]) + d);
      }
    }
    if (radius < own) {
      r.radius[0] = r.radius[1] = static_cast<float>(radius);
      r.flags |= kRadiusClampedFlag;
    }
  });
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
  // What layers below gave was read from the cache just replaced; it has not changed.
  if (below_.cache != nullptr) below_.cache = cache_.get();
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
// next.
void Baker::everywhere(int layer, const std::string& stage) {
  use_layer(layer);
  const SurfacePoints surfaces(world_.tracer());
  const double coarsest = layer_settings_.max_radius * world_.diagonal();
  const double finest = layer_settings_.min_radius * world_.diagonal();
  const int waves = std::min(
      kFirstViewWave, static_cast<int>(std::ceil(std::log2(std::max(1.0, coarsest / finest)))) + 2);
  for (int wave = next_wave_everywhere(layer); wave < waves && !is_stopped(); ++wave) {
    const double spacing = std::ldexp(coarsest, -wave);
    report(stage, double(wave) / waves);
    const Points open =
        uncovered(surfaces.points(spacing, random_key(settings_.seed, wave)), layer, nullptr);
    Records fresh = gather_all(thin(open, 0.7 * std::max(spacing, finest)), layer, wave);
    if (stopped_) return;
    clamp_by_neighbours(fresh, layer, nullptr);
    seal(std::move(fresh));
  }
}

Baker::Records Baker::bake_tile(const BakeView& view, const PixelRect& tile, int layer,
                                int first_wave, Worker& worker) {
  Records all;
  IrradianceCache own({}, origin_);
  int wave = first_wave;
  for (int stride = kFinestGlobalStride / 2; stride >= 1; stride /= 2, ++wave) {
    Records fresh, found;
    for (const SurfacePoint& p : view_points(world_, view, tile, stride, true)) {
      const IrradianceQuery query{layer, p.position, p.normal, p.min_radius};
      if (cache_->covers(query, kCoveredWithin) || own.covers(query, kCoveredWithin)) continue;
      SurfaceRecord r = placed(p, layer, wave);
      if (const auto it = unfinished_.find(r.key); it != unfinished_.end()) {
        found.push_back(it->second);
        found.back().flags &= ~kUnfinishedViewFlag;
        continue;
      }
      gather(p, r, worker);
      fresh.push_back(r);
    }
    clamp_by_neighbours(fresh, layer, &own);
    all.insert(all.end(), fresh.begin(), fresh.end());
    all.insert(all.end(), found.begin(), found.end());
    std::sort(all.begin(), all.end(), RecordOrder());
    own = IrradianceCache(all, origin_);
  }
  return all;
}

void Baker::views(int layer) {
  use_layer(layer);
  int wave = kFirstViewWave;
  for (int stride = kCoarsestStride; stride >= kFinestGlobalStride; stride /= 2, ++wave) {
    for (const BakeView& view : request_.views) {
      if (is_stopped()) return;
      const PixelRect frame{0, 0, view.width, view.height};
      const Points open = uncovered(
          view_points(world_, view, frame, stride, stride < kCoarsestStride), layer, nullptr);
      report("gather", 0.1 * (wave - kFirstViewWave));
      Records fresh = gather_all(open, layer, wave);
      if (stopped_) return;
      clamp_by_neighbours(fresh, layer, nullptr);
      seal(std::move(fresh));
    }
  }
  for (const BakeView& view : request_.views) {
    std::vector<PixelRect> tiles;
    for (int y = 0; y < view.height; y += kTilePixels)
      for (int x = 0; x < view.width; x += kTilePixels)
        tiles.push_back(
            {x, y, std::min(x + kTilePixels, view.width), std::min(y + kTilePixels, view.height)});
    std::vector<Records> baked(tiles.size());
    std::atomic<bool> stop = false;
    std::atomic<std::size_t> done = 0;
    parallel_for_slots(request_.threads, tiles.size(), 1, [&](std::size_t i, int slot) {
      if (stop || (request_.stop_requested && request_.stop_requested())) {
        stop = true;
        return;
      }
      baked[i] = bake_tile(view, tiles[i], layer, wave, workers_[slot]);
      if (request_.stop_requested && request_.stop_requested()) {
        // Whether this tile was finished cannot be told: it is baked again.
        baked[i].clear();
        stop = true;
        return;
      }
      if (slot == 0)
        report("gather", 0.3 + 0.7 * double(++done) / double(tiles.size()));
      else
        ++done;
    });
    Records fresh;
    for (const Records& r : baked) fresh.insert(fresh.end(), r.begin(), r.end());
    if (stop) {
      for (SurfaceRecord& r : fresh) r.flags |= kUnfinishedViewFlag;
      stopped_ = true;
    }
    seal(std::move(fresh));
    if (stopped_) return;
  }
  for (auto& [key, r] : unfinished_) r.flags &= ~kUnfinishedViewFlag;
}

// Mean change from the layer below to `layer`, at the records of `layer`, relative to its mean.
double Baker::change_of(int layer) const {
  double change = 0, sum = 0;
  for (const SurfaceRecord& r : records_) {
    if (r.layer() != layer) continue;
    const Vec3d p = Vec3d(r.position[0], r.position[1], r.position[2]) + origin_;
    const Vec3d n(r.normal[0], r.normal[1], r.normal[2]);
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
  // What no tile chose again belongs to other views, or to tiles that have not been reached again.
  if (!unfinished_.empty()) {
    for (const SurfaceRecord& r : records_)
      if (r.layer() == top_layer(settings_)) unfinished_.erase(r.key);
    Records others;
    for (const auto& [key, r] : unfinished_) others.push_back(r);
    seal(std::move(others));
  }
  for (const Worker& w : workers_) stats_.counters += w.counters;
  stats_.records_added = records_.size() - existing_;
  return {cache_, std::move(stats_), truncation_bound_, layers_, stopped_};
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
