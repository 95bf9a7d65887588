#include "cache/answer_check.h"

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>

#include "cache/irradiance_cache.h"

namespace brume {
namespace {

using Json = nlohmann::ordered_json;

// A point with its answer.
struct Trial {
  const CheckedPoint* point = nullptr;
  double answer = 0;

  double truth() const { return point->truth.mean(); }
  double truth_error() const { return point->truth.error(); }
  // An estimate of (answer - truth)^2 without the paths' own variance.
  double square() const {
    return (answer - point->truth.half_mean(0)) * (answer - point->truth.half_mean(1));
  }
  // Of that estimate: each half is twice as uncertain as both.
  double square_variance() const {
    const double half_variance = 2 * truth_error() * truth_error();
    return half_variance * (2 * std::max(0.0, square()) + half_variance);
  }
};

// Only the records named answer, as they would among all others.
std::optional<double> answer_of(const CheckedPoint& point, std::span<const SurfaceRecord> by_key,
                                const Vec3d& origin) {
  if (point.stretches == CheckedPoint::kNobody) return point.gathered;
  std::vector<SurfaceRecord> named;
  for (const std::uint64_t key : point.keys) {
    const auto found = std::partition_point(by_key.begin(), by_key.end(),
                                            [&](const SurfaceRecord& r) { return r.key < key; });
    if (found == by_key.end() || found->key != key) return std::nullopt;
    named.push_back(*found);
  }
  const IrradianceCache cache(std::move(named), origin);
  return luminance(cache
                       .irradiance({kTopLayer, point.position, point.normal,
                                    std::ldexp(point.footprint, point.stretches)})
                       .irradiance);
}

struct MeanAndError {
  double mean = 0, error = 0;
};
template <typename Value>
MeanAndError mean_of(const std::vector<Trial>& trials, const Value& value) {
  const double n = static_cast<double>(trials.size());
  double sum = 0, squares = 0;
  for (const Trial& t : trials) sum += value(t) / n;
  for (const Trial& t : trials) squares += (value(t) - sum) * (value(t) - sum);
  return {sum, n > 1 ? std::sqrt(squares / (n * (n - 1))) : 0};
}

CheckedPoint united(const CheckedPoint& a, const CheckedPoint& b) {
  CheckedPoint all = a.stretches <= b.stretches ? a : b;
  if (a.stretches == b.stretches) {
    all.keys.clear();
    std::set_union(a.keys.begin(), a.keys.end(), b.keys.begin(), b.keys.end(),
                   std::back_inserter(all.keys));
  }
  if (all.stretches != CheckedPoint::kNobody)
    all.gathered.reset();
  else if (!all.gathered)
    all.gathered = a.gathered ? a.gathered : b.gathered;
  all.truth = a.truth.paths >= b.truth.paths ? a.truth : b.truth;
  return all;
}

Json json_of_point(const CheckedPoint& p) {
  Json json = {{"position", {p.position.x, p.position.y, p.position.z}},
               {"normal", {p.normal.x, p.normal.y, p.normal.z}},
               {"footprint", p.footprint}};
  if (p.stretches != CheckedPoint::kNobody) {
    json["stretches"] = p.stretches;
    json["keys"] = p.keys;
  }
  if (p.gathered) json["gathered"] = *p.gathered;
  if (p.truth.paths > 0) {
    json["paths"] = p.truth.paths;
    json["halves"] = {p.truth.half[0], p.truth.half[1]};
    json["squares"] = p.truth.squares;
  }
  return json;
}

Vec3d vector_of(const Json& json) { return {json.at(0), json.at(1), json.at(2)}; }

CheckedPoint point_of(const Json& json) {
  CheckedPoint p;
  p.position = vector_of(json.at("position"));
  p.normal = vector_of(json.at("normal"));
  p.footprint = json.at("footprint");
  if (json.contains("stretches")) {
    p.stretches = std::clamp<int>(json["stretches"], 0, CheckedPoint::kNobody - 1);
    p.keys = json.at("keys").get<std::vector<std::uint64_t>>();
    std::sort(p.keys.begin(), p.keys.end());
  }
  if (json.contains("gathered")) p.gathered = json["gathered"].get<double>();
  if (json.contains("paths")) {
    p.truth.paths = std::max(0, json["paths"].get<int>());
    p.truth.half[0] = json.at("halves").at(0);
    p.truth.half[1] = json.at("halves").at(1);
    p.truth.squares = json.at("squares");
  }
  return p;
}

}  // namespace

double TracedIrradiance::error() const {
  const double variance = squares / paths - mean() * mean();
  return std::sqrt(std::max(0.0, variance) / std::max(1, paths - 1));
}

bool AnswerCheck::is_doubtful() const {
  constexpr double kMostBias = 0.03, kMostRmse = 0.1;
  return std::abs(bias) > std::max(kMostBias, 3 * bias_error) || rmse_low > kMostRmse;
}

AnswerCheck summarise(const CheckedRequests& checked, std::span<const SurfaceRecord> records,
                      const Vec3d& origin) {
  std::vector<SurfaceRecord> by_key;
  for (const SurfaceRecord& r : records)
    if (r.layer() == kTopLayer) by_key.push_back(r);
  std::sort(by_key.begin(), by_key.end(),
            [](const SurfaceRecord& a, const SurfaceRecord& b) { return a.key < b.key; });
  std::vector<Trial> trials;
  AnswerCheck check;
  for (const CheckedRequest& request : checked)
    for (const CheckedPoint& point : request.points) {
      if (point.truth.paths == 0) continue;
      const std::optional<double> answer = answer_of(point, by_key, origin);
      if (!answer) continue;
      trials.push_back({&point, *answer});
      check.gathered += point.stretches == CheckedPoint::kNobody;
      check.paths = point.truth.paths;
    }
  check.points = static_cast<int>(trials.size());
  if (trials.empty()) return check;
  check.truth = mean_of(trials, [](const Trial& t) { return t.truth(); }).mean;
  check.answer = mean_of(trials, [](const Trial& t) { return t.answer; }).mean;
  const double scale = std::max(check.truth, check.answer);
  if (scale > 0) {
    const MeanAndError off = mean_of(trials, [](const Trial& t) { return t.answer - t.truth(); });
    check.bias = off.mean / scale;
    check.bias_error = off.error / scale;
    const double square = mean_of(trials, [](const Trial& t) { return t.square(); }).mean;
    double variance = 0;
    for (const Trial& t : trials) variance += t.square_variance();
    const double error = std::sqrt(variance) / double(trials.size());
    const auto root = [&](double errors) {
      return std::sqrt(std::max(0.0, square + errors * error)) / scale;
    };
    check.rmse = root(0);
    check.rmse_low = root(-2);
    check.rmse_high = root(2);
  }
  double most = -kInfinity;
  for (const Trial& t : trials) {
    const double sure = std::abs(t.answer - t.truth()) - 2 * t.truth_error();
    if (!(sure > most)) continue;
    most = sure;
    check.worst_position = t.point->position;
    check.worst_truth = t.truth();
    check.worst_truth_error = t.truth_error();
    check.worst_answer = t.answer;
  }
  return check;
}

CheckedRequests united(const CheckedRequests& a, const CheckedRequests& b) {
  CheckedRequests all = a;
  for (const CheckedRequest& other : b) {
    const auto same = std::find_if(all.begin(), all.end(), [&](const CheckedRequest& r) {
      return r.request == other.request;
    });
    if (same == all.end()) {
      all.push_back(other);
    } else if (same->points.size() != other.points.size()) {
      if (other.points.size() > same->points.size()) *same = other;  // More points were asked for.
    } else {
      for (std::size_t i = 0; i < other.points.size(); ++i)
        same->points[i] = united(same->points[i], other.points[i]);
    }
  }
  std::sort(all.begin(), all.end(),
            [](const CheckedRequest& x, const CheckedRequest& y) { return x.request < y.request; });
  return all;
}

std::string checks_text(const CheckedRequests& checked) {
  if (checked.empty()) return "";
  Json all = Json::array();
  for (const CheckedRequest& request : checked) {
    Json points = Json::array();
    for (const CheckedPoint& point : request.points) points.push_back(json_of_point(point));
    all.push_back({{"request", request.request}, {"points", std::move(points)}});
  }
  return all.dump();
}

CheckedRequests read_checks(const std::string& text) {
  try {
    CheckedRequests checked;
    for (const Json& request : Json::parse(text)) {
      checked.push_back({request.at("request"), {}});
      for (const Json& point : request.at("points"))
        checked.back().points.push_back(point_of(point));
    }
    return checked;
  } catch (const Json::exception&) {
    return {};
  }
}

}  // namespace brume
