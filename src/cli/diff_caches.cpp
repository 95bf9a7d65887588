#include "cli/diff_caches.h"

#include "cache/cache_difference.h"
#include "cli/cache_input.h"
#include "cli/diff_limits.h"
#include "cli/outputs.h"
#include "cli/text_table.h"
#include "core/error.h"

namespace brume {
namespace {

Metrics metrics_of(const CacheDifference& d) {
  Metrics all{{"only_a", double(d.only_a)},
              {"only_b", double(d.only_b)},
              {"equal", double(d.equal)},
              {"different", double(d.different)}};
  using Values = CacheDifference::Values;
  const std::pair<const char*, double Values::*> values[] = {
      {"mae", &Values::mae},
      {"rmse", &Values::rmse},
      {"relmse", &Values::relmse},
      {"signed_mean", &Values::signed_mean},
      {"p99", &Values::p99},
      {"max", &Values::max},
      {"gradient_rmse", &Values::gradient_rmse},
      {"radius_rmse", &Values::radius_rmse}};
  for (const auto& [name, member] : values)
    all.emplace_back(name, d.values ? std::optional<double>((*d.values).*member) : std::nullopt);
  const bool has_answers = d.answers.points > d.answers.uncovered;
  const auto answer = [&](double value) {
    return has_answers ? std::optional<double>(value) : std::nullopt;
  };
  all.emplace_back("answers_bias", answer(d.answers.bias));
  all.emplace_back("answers_rmse", answer(d.answers.rmse));
  all.emplace_back(
      "answers_uncovered",
      d.answers.points == 0 ? 0 : double(d.answers.uncovered) / double(d.answers.points));
  return all;
}

// Settings that only one has, or that differ: {"cells": {"a": [16,50], "b": [8,25]}}.
Json settings_difference(const CacheHeader& a, const CacheHeader& b) {
  Json left = settings_json(a.settings), right = settings_json(b.settings);
  // Text that is no object is compared as a whole.
  for (Json* settings : {&left, &right})
    if (!settings->is_object()) *settings = Json({{"settings", *settings}});
  Json difference = Json::object();
  for (const auto& [key, value] : left.items())
    if (!right.contains(key) || right[key] != value)
      difference[key] = {{"a", value}, {"b", right.value(key, Json())}};
  for (const auto& [key, value] : right.items())
    if (!left.contains(key)) difference[key] = {{"a", nullptr}, {"b", value}};
  return difference;
}

Json difference_json(const CacheContents& a, const CacheContents& b, const Metrics& metrics,
                     const CacheDifference& difference) {
  Json object = Json::object();
  object["only_a"] = difference.only_a;
  object["only_b"] = difference.only_b;
  object["equal"] = difference.equal;
  object["different"] = difference.different;
  for (const auto& [name, value] : metrics)
    if (!object.contains(name)) object[name] = value ? Json(*value) : Json();
  object["same_fingerprint"] = a.header.fingerprint == b.header.fingerprint;
  object["fingerprints"] = {a.header.fingerprint.hex(), b.header.fingerprint.hex()};
  object["same_origin"] = a.header.origin == b.header.origin;
  object["same_volume_records"] = a.volume == b.volume;
  object["settings"] = settings_difference(a.header, b.header);
  return object;
}

void print_difference(std::ostream& out, const CacheContents& a, const CacheContents& b,
                      const Metrics& metrics) {
  const bool is_same = a.header.fingerprint == b.header.fingerprint;
  out << "fingerprints  "
      << (is_same
              ? "equal"
              : "different: " + a.header.fingerprint.hex() + " and " + b.header.fingerprint.hex())
      << '\n';
  const Json settings = settings_difference(a.header, b.header);
  if (settings.empty()) out << "settings      equal\n";
  for (const auto& [key, values] : settings.items())
    out << "settings      " << printable(key) << ": " << printable(values["a"].dump()) << " and "
        << printable(values["b"].dump()) << '\n';
  if (a.header.origin != b.header.origin) out << "origins       different\n";
  if (a.volume.size() + b.volume.size() > 0)
    out << "medium        " << (a.volume == b.volume ? "equal" : "different") << " records: "
        << a.volume.size() << " and " << b.volume.size() << "; values compare surface records\n";
  std::vector<std::vector<std::string>> rows;
  for (const auto& [name, value] : metrics)
    rows.push_back({name, value ? shown_number(*value) : "-"});
  out << '\n';
  print_table(out, rows);
}

}  // namespace

int diff_caches(const std::string& a, const std::string& b, const std::vector<std::string>& limits,
                const CommandContext& context) {
  std::vector<std::string> names;
  for (const auto& [name, value] : metrics_of({})) names.push_back(name);
  std::vector<MetricLimit> parsed;
  for (const std::string& text : limits) parsed.push_back(parse_metric_limit(text, names));

  const CacheContents left = read_cache_contents(a), right = read_cache_contents(b);
  const CacheDifference difference = compare_caches(left, right);
  const Metrics metrics = metrics_of(difference);
  if (context.json)
    print_json(context, difference_json(left, right, metrics, difference));
  else
    print_difference(context.out, left, right, metrics);
  if (const std::string over = metrics_over(metrics, parsed); !over.empty())
    throw Error(ErrorKind::Threshold,
                printable(a) + ": " + over + ": compared with " + printable(b));
  return 0;
}

}  // namespace brume
