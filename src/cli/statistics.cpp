#include "cli/statistics.h"

#include <sys/resource.h>

#include <algorithm>

namespace brume {
namespace {

Json by_stage(const std::vector<std::pair<std::string, double>>& seconds) {
  Json object = Json::object();
  for (const auto& [stage, elapsed] : seconds) object[stage] = elapsed;
  return object;
}

}  // namespace

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

std::uint64_t peak_memory_bytes() {
  struct rusage usage {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;  // Linux counts in KiB.
}

void Statistics::add_seconds(const std::string& stage, double elapsed) {
  const auto known = std::find_if(seconds.begin(), seconds.end(),
                                  [&](const auto& entry) { return entry.first == stage; });
  if (known != seconds.end())
    known->second += elapsed;
  else
    seconds.emplace_back(stage, elapsed);
}

double Statistics::total_seconds() const {
  double sum = 0;
  for (const auto& [stage, elapsed] : seconds) sum += elapsed;
  return sum;
}

void Statistics::add_bake(const BakeStats& stats) {
  bake_seconds.insert(bake_seconds.end(), stats.seconds.begin(), stats.seconds.end());
  counters += stats.counters;
  records_added += stats.records_added;
}

void Statistics::describe(const Lighting& lighting, const Effects& planned) {
  effects = planned.names();
  light_volume_rms_error = lighting.rms_error();
  light_volume_max_error = lighting.max_error();
  light_volume_bytes = lighting.memory_bytes();
}

void Statistics::describe(const DeepStats& deep) {
  details["orders"] = deep.orders;
  details["truncation_bound"] = deep.truncation_bound;
  details["solve"] = {{"scatterings", deep.scatterings},
                      {"accelerated", deep.is_accelerated},
                      {"applications", deep.applications},
                      {"ratio", deep.ratio},
                      {"surface_records", deep.surface_records},
                      {"volume_records", deep.volume_records},
                      {"strata", deep.strata},
                      {"seconds", deep.seconds}};
}

Json Statistics::to_json() const {
  Json all = Json::object();
  all["seconds"] = by_stage(seconds);
  all["seconds"]["total"] = total_seconds();
  if (!bake_seconds.empty()) all["bake_seconds"] = by_stage(bake_seconds);
  all["rays"] = counters.rays;
  all["segments"] = counters.segments;
  all["records"] = records;
  all["records_added"] = records_added;
  all["peak_bytes"] = peak_memory_bytes();
  all["effects"] = effects;
  all["shadow_rays"] = counters.shadow_rays;
  all["medium_shadow_rays"] = counters.medium_shadow_rays;
  all["march_rays"] = counters.march_rays;
  all["light_volume_lookups"] = counters.light_volume_lookups;
  all["light_volume_rms_error"] = light_volume_rms_error;
  all["light_volume_max_error"] = light_volume_max_error;
  all["light_volume_bytes"] = light_volume_bytes;
  all["gathers"] = counters.gathers;
  all["fallback_gathers"] = counters.fallback_gathers;
  all["cache_queries"] = counters.cache_queries;
  all["cache_clamps"] = counters.cache_clamps;
  all["cache_misses"] = counters.cache_misses;
  all.update(details);
  return all;
}

}  // namespace brume
