// --fail-above METRIC=V: numbers that a comparison must not pass.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace brume {

// In the order they are shown; nothing where there is no such number, as without anything to
// compare.
using Metrics = std::vector<std::pair<std::string, std::optional<double>>>;

struct MetricLimit {
  std::string metric;
  double value = 0;
};

// Throws Error(Usage) for what does not read METRIC=V, V at least 0, with one of these names.
MetricLimit parse_metric_limit(const std::string& text, const std::vector<std::string>& names);

// "rmse 0.2 is above 0.1, ...", or empty. Either sign is a difference; what is no number is above
// any limit.
std::string metrics_over(const Metrics& metrics, const std::vector<MetricLimit>& limits);

}  // namespace brume
