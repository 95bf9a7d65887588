// How true a cache's answers are at points that were asked for, as a cache file keeps it: who
// answers there, and the truth. What follows is computed when wanted, so that shards' checks unite
// to that of one process.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cache/record.h"
#include "core/math.h"

namespace brume {

// Luminance of irradiance at a point by traced paths, in two independent halves: even and odd ones.
struct TracedIrradiance {
  double half[2] = {0, 0};  // Sums.
  double squares = 0;       // Sum of squares, of both.
  int paths = 0;            // An even number.

  // None of these is defined for no paths.
  double half_mean(int i) const { return 2 * half[i] / paths; }
  double mean() const { return (half[0] + half[1]) / paths; }
  double error() const;  // Standard error of the mean.

  friend bool operator==(const TracedIrradiance&, const TracedIrradiance&) = default;
};

struct CheckedPoint {
  static constexpr int kNobody = 255;

  Vec3d position{0.0}, normal{0.0};
  double footprint = 0;
  int stretches = kNobody;          // Doublings of the footprint before records answered.
  std::vector<std::uint64_t> keys;  // Of those that then did, ascending; they see the point.
  std::optional<double> gathered;   // Where nobody did: what a gather finds, luminance.
  TracedIrradiance truth;           // No paths: another shard's.

  friend bool operator==(const CheckedPoint&, const CheckedPoint&) = default;
};

// Points of one request (request_hash), in the order that they were chosen in.
struct CheckedRequest {
  std::uint64_t request = 0;
  std::vector<CheckedPoint> points;

  friend bool operator==(const CheckedRequest&, const CheckedRequest&) = default;
};
using CheckedRequests = std::vector<CheckedRequest>;  // Ascending, each request once.

// Of irradiance's luminance. Relative numbers are over the mean of the truths or of the answers,
// whichever is larger, so that light where none should be counts. What the paths are off themselves
// is taken out of squares by two independent halves.
struct AnswerCheck {
  int points = 0, gathered = 0;  // Of the points, those that no record answered.
  double truth = 0, answer = 0;  // Means.
  double bias = 0,
         bias_error = 0;  // The error holds the paths' and that these are some of all points.
  // Over these points; low and high: two standard errors of its square by the paths to either side.
  double rmse = 0, rmse_low = 0, rmse_high = 0;
  // The one that is surely farthest off.
  Vec3d worst_position{0.0};
  double worst_truth = 0, worst_truth_error = 0, worst_answer = 0;
  int paths = 0;  // At a point.

  // Farther off than paths and chance explain: a bias above 3 % and three standard errors, or an
  // RMSE above a tenth by two.
  bool is_doubtful() const;
};

// `records` in RecordOrder, positions relative to `origin`. Points without a truth, or whose
// records are not there, do not count.
AnswerCheck summarise(const CheckedRequests& checked, std::span<const SurfaceRecord> records,
                      const Vec3d& origin);

// What checks of parts of one cache say of the whole.
CheckedRequests united(const CheckedRequests& a, const CheckedRequests& b);

// One line of JSON; "" for nothing. What reads it takes other text for nothing.
std::string checks_text(const CheckedRequests& checked);
CheckedRequests read_checks(const std::string& text);

}  // namespace brume
