// What a run did: seconds by stage, counters, memory. The same numbers go to --json, --stats and
// image metadata.
#pragma once

#include <chrono>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "bake/bake.h"
#include "plan/effects.h"

namespace brume {

using Json = nlohmann::ordered_json;

double seconds_since(std::chrono::steady_clock::time_point begin);
// Of this process since it began.
std::uint64_t peak_memory_bytes();

struct Statistics {
  std::vector<std::pair<std::string, double>> seconds;       // By stage, in order.
  std::vector<std::pair<std::string, double>> bake_seconds;  // The stages of "bake".
  Counters counters;
  std::size_t records = 0, records_added = 0;
  std::vector<std::string> effects;
  double light_volume_rms_error = 0, light_volume_max_error = 0;
  std::size_t light_volume_bytes = 0;
  Json details = Json::object();  // What one verb alone has to say.

  // Runs `work` and adds its wall-clock time to `stage`.
  template <typename Work>
  auto timed(const std::string& stage, Work&& work) {
    const auto begin = std::chrono::steady_clock::now();
    struct AddOnExit {
      Statistics& to;
      const std::string& stage;
      std::chrono::steady_clock::time_point begin;
      ~AddOnExit() { to.add_seconds(stage, seconds_since(begin)); }
    } add{*this, stage, begin};
    return work();
  }
  void add_seconds(const std::string& stage, double elapsed);
  double total_seconds() const;
  void add_bake(const BakeStats& stats);
  void describe(const Lighting& lighting, const Effects& planned);
  void describe(const DeepStats& deep);

  Json to_json() const;
};

}  // namespace brume
