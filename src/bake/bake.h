// Fills an irradiance cache: place, gather, radius, clamp, seal, wave by wave.
//
// Records are pure functions of (fingerprint, key); placement reads sealed waves and its own cell
// only, so the records depend on no thread count, shard or interruption (docs/decisions/0001).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "cache/cache_journal.h"
#include "cache/irradiance_cache.h"
#include "gather/gather.h"
#include "plan/effects.h"
#include "scene/scene.h"

namespace brume {

// What the fingerprint covers besides the world.
struct BakeSettings {
  GatherOptions gather;
  int bounces = 4;
  int volume_bounces = kEveryOrder;  // Scatterings in the medium between two surfaces.
  std::uint64_t seed = 1;
  // Split-sphere accuracy [WRC88]: radius = error * mean distance; smaller is finer.
  double error = 0.15;
  // How close together records may be placed over all surfaces (BakeRequest::everywhere) [m]. Those
  // of views are placed by the footprints of pixels.
  double min_radius = 0.01;
  double max_radius = kInfinity;  // No record reaches farther [m].
  LightDepth light_depth = LightDepth::Volumes;

  std::string to_json() const;  // One line, every member.
};

// World, settings, seed and algorithm version; never cameras, threads or paths.
Fingerprint bake_fingerprint(const World& world, const BakeSettings& settings);

// Of the solve for deep records; zeros where there was none, or it was found.
struct DeepStats {
  int orders = 0;       // Reflections that were added up.
  int scatterings = 0;  // Most scatterings in the medium that were added up between two of them.
  bool is_accelerated = false;  // Scatterings were summed by GMRES.
  int applications = 0;         // Of the transport operator.
  std::vector<double> changes;  // What each order added, in the mean over records, of all so far.
  double ratio = 0;             // Of the last change to the one before.
  // No deep record's rest, from orders that were left out, is larger than this part of its light,
  // so neither is that of any irradiance (DeepSolution). 0 when everything asked for was added up.
  double truncation_bound = 0;
  std::size_t surface_records = 0, volume_records = 0, strata = 0;
  double seconds = 0;

  bool is_solved() const { return surface_records + volume_records > 0; }
  // One line, for the cache file: every member but the seconds.
  std::string to_json() const;
};

struct BakeView {
  std::string name;
  Camera camera;
  int width = 0, height = 0;
};

// Part `index` of `count` of the finest waves; what comes before them is the same in every shard.
struct Shard {
  std::uint32_t index = 0, count = 1;
};

struct BakeRequest {
  std::vector<BakeView> views;
  bool everywhere = false;  // Cover all surfaces instead.
  bool deep_only = false;   // Cover nothing: only what gathers anywhere see.
  int threads = 0;
  Shard shard{};
  // Stops before the cache holds more records than this, at the same place for any number of
  // threads.
  std::size_t record_limit = std::numeric_limits<std::size_t>::max();
  // Where gathers are noted as they are made, and found that an earlier run made; null: nowhere.
  CacheJournal* journal = nullptr;
  // Stage name and fraction of it; from one thread.
  std::function<void(const std::string& stage, double fraction)> progress;
  std::function<bool()> stop_requested;
  // True once for each time that somebody wants to see what there is; then snapshot() gets all
  // records so far, as a bake stopped here would leave them, and how deep ones were solved for if
  // this bake did. From any thread, one at a time; the bake goes on.
  std::function<bool()> snapshot_requested;
  std::function<void(std::shared_ptr<const IrradianceCache>, const DeepStats&)> snapshot;
};

// What of a request decides which records it makes: views and sizes.
std::uint64_t request_hash(const BakeRequest& request);

struct BakeStats {
  std::vector<std::pair<std::string, double>> seconds;  // By stage, in order.
  Counters counters;
  std::size_t records_added = 0;
};

struct BakeResult {
  std::shared_ptr<const IrradianceCache> cache;
  std::shared_ptr<const IncidentField> scattered;  // For light_below(); null where none was made.
  BakeStats stats;
  DeepStats deep;
  // stop_requested() said so, or a limit is reached; what is in the cache is whole waves or cells.
  bool is_stopped = false;
  bool is_at_record_limit = false;
};

inline constexpr int kMaxBounces = 250;

using Scattered = std::shared_ptr<const IncidentField>;

// What gathers for top records see at their hits and in the medium. `cache` and `world` must
// outlive it. Takes `scattered` for light in the medium where it is of this cache's very records;
// else costs a field of them.
HitLight light_below(const IrradianceCache& cache, const BakeSettings& settings, const World& world,
                     int threads, const Scattered& scattered = nullptr);
// The same of deep records alone.
HitLight deep_light(const IrradianceCache& cache, const World& world, int threads,
                    const Scattered& scattered = nullptr);

// How far a record may reach, in world units: accuracy times the mean distance of what its gather
// saw (split sphere [WRC88]) or of what shines there, never farther than the nearest surface that
// the gather saw, nor than the gradient allows (|grad E| R <= accuracy * E along the surface).
// Where nothing arrives, accuracy times `clearance`, the distance to the nearest surface above the
// record's plane (RayTracer::clearance). `unit`: metres of a world unit.
double record_radius(const GatherResult& gather, const Vec3d& normal, double clearance,
                     const BakeSettings& settings, double unit);

// What a pixel asks of a cache about a point that it sees, where records are placed, found, looked
// for and explained alike. `footprint`: kFootprintPixels of its pixels.
IrradianceQuery pixel_query(const World& world, const Vec3d& position, const Vec3d& normal,
                            double footprint);

// Adds what the views (or all surfaces) need to `existing` (null: nothing). Without indirect light
// to hold (Effects::indirect) the cache is empty. Throws Error(Stopped) never: see is_stopped.
BakeResult bake(const Lighting& lighting, const BakeSettings& settings, const BakeRequest& request,
                const IrradianceCache* existing);

// Whether that takes a solve for deep records, which `existing` (null: nothing) does not hold yet.
bool needs_deep_bake(const World& world, const BakeSettings& settings,
                     const IrradianceCache* existing);

// A pixel's footprint in records: where less wide, records act as if this many pixels wide, both
// when placing and when rendering.
inline constexpr double kFootprintPixels = 1.5;
// Along each edge of a pixel, where records may be placed: what is seen within one may differ much.
inline constexpr int kPointsPerPixel = 2;

}  // namespace brume
