#include "cli/diff_limits.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "cli/text_table.h"
#include "core/error.h"

namespace brume {

MetricLimit parse_metric_limit(const std::string& text, const std::vector<std::string>& names) {
  const std::size_t equals = text.find('=');
  MetricLimit limit{text.substr(0, equals), 0};
  const std::string number = equals == std::string::npos ? "" : text.substr(equals + 1);
  const char* const end = number.data() + number.size();
  const auto [stopped, problem] = std::from_chars(number.data(), end, limit.value);
  if (problem != std::errc() || stopped != end || !(limit.value >= 0))
    throw Error(ErrorKind::Usage, "--fail-above: '" + printable(text, 60) +
                                      "' does not read METRIC=V with V at least 0");
  if (std::find(names.begin(), names.end(), limit.metric) == names.end()) {
    std::string list;
    for (const std::string& n : names) list += (list.empty() ? "" : ", ") + n;
    throw Error(ErrorKind::Usage, "--fail-above: no metric is called '" +
                                      printable(limit.metric, 60) + "': choose from " + list);
  }
  return limit;
}

std::string metrics_over(const Metrics& metrics, const std::vector<MetricLimit>& limits) {
  std::string over;
  for (const MetricLimit& limit : limits) {
    const auto value = std::find_if(metrics.begin(), metrics.end(), [&](const auto& m) {
                         return m.first == limit.metric;
                       })->second;
    if (value && std::abs(*value) <= limit.value) continue;
    over += (over.empty() ? "" : ", ") + limit.metric + " " +
            (value ? shown_number(*value) : std::string("without a value")) + " is above " +
            shown_number(limit.value);
  }
  return over;
}

}  // namespace brume
