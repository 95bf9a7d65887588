#include "cache/cache_difference.h"

#include <algorithm>
#include <cstring>

#include "cache/irradiance_cache.h"

namespace brume {
namespace {

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

double record_luminance(const SurfaceRecord& r) {
  return luminance(RgbD(r.irradiance[0], r.irradiance[1], r.irradiance[2]));
}
Vec3d luminance_gradient(const SurfaceRecord& r) {
  return luminance(RgbGradient{vector(r.gradient), vector(r.gradient + 3), vector(r.gradient + 6)});
}

bool is_before(const SurfaceRecord& a, const SurfaceRecord& b) {
  return a.layer() != b.layer() ? a.layer() < b.layer() : a.key < b.key;
}

std::vector<SurfaceRecord> sorted_by_key(const CacheContents& contents) {
  std::vector<SurfaceRecord> records = contents.records;
  for (SurfaceRecord& r : records) r.flags &= ~kUnfinishedViewFlag;
  std::stable_sort(records.begin(), records.end(), is_before);
  return records;
}

// Sums over records that are in both.
class Sums {
 public:
  void add(const SurfaceRecord& a, const SurfaceRecord& b) {
    const double ea = record_luminance(a), eb = record_luminance(b), d = ea - eb;
    differences_.push_back(std::abs(d));
    references_.push_back(eb);
    sum_a_ += ea;
    sum_b_ += eb;
    const Vec3d ga = luminance_gradient(a), gb = luminance_gradient(b);
    gradient_change2_ += (ga - gb).length2();
    gradient2_ += gb.length2();
    for (int i = 0; i < 2; ++i) {
      const double ratio = std::log(double(a.radius[i]) / b.radius[i]);
      log_radius2_ += ratio * ratio / 2;
    }
  }

  std::optional<CacheDifference::Values> values() {
    if (differences_.empty()) return std::nullopt;
    CacheDifference::Values v;
    const double n = static_cast<double>(differences_.size()), mean = sum_b_ / n;
    for (std::size_t i = 0; i < differences_.size(); ++i) {
      const double d = differences_[i], e = references_[i];
      v.mae += d / n;
      v.rmse += d * d / n;
      // Against the darkest as the image metric of that name: a hundredth of the mean is the floor.
      if (d > 0) v.relmse += d * d / (e * e + 1e-4 * mean * mean) / n;
    }
    v.rmse = std::sqrt(v.rmse);
    std::sort(differences_.begin(), differences_.end());
    v.p99 = differences_[static_cast<std::size_t>(0.99 * (n - 1))];
    v.max = differences_.back();
    if (mean > 0) {
      for (double* of_mean : {&v.mae, &v.rmse, &v.p99, &v.max}) *of_mean /= mean;
      v.signed_mean = sum_a_ / sum_b_ - 1;
    } else if (v.max > 0) {  // Anything is infinitely far from black.
      v.mae = v.rmse = v.p99 = v.max = v.signed_mean = kInfinity;
    }
    if (gradient_change2_ > 0)
      v.gradient_rmse = gradient2_ > 0 ? std::sqrt(gradient_change2_ / gradient2_) : kInfinity;
    v.radius_rmse = std::sqrt(log_radius2_ / n);
    return v;
  }

 private:
  std::vector<double> differences_, references_;
  double sum_a_ = 0, sum_b_ = 0, gradient_change2_ = 0, gradient2_ = 0, log_radius2_ = 0;
};

CacheDifference::Answers compare_answers(const CacheContents& a, const CacheContents& b) {
  // Enough to tell; all of a large cache would take longer than the rest.
  constexpr std::size_t kMostPoints = 100'000;
  CacheDifference::Answers answers;
  int top = -1;
  for (const SurfaceRecord& r : b.records) top = std::max(top, r.layer());
  std::vector<const SurfaceRecord*> places;
  for (const SurfaceRecord& r : b.records)
    if (r.layer() == top) places.push_back(&r);
  const IrradianceCache cache(a.records, a.header.origin);
  const std::size_t step =
      std::max<std::size_t>(1, (places.size() + kMostPoints - 1) / kMostPoints);
  double difference = 0, squares = 0, sum = 0;
  for (std::size_t i = 0; i < places.size(); i += step) {
    const SurfaceRecord& r = *places[i];
    ++answers.points;
    const InterpolatedIrradiance found = cache.irradiance(
        {top, b.header.origin + vector(r.position), vector(r.normal).normalized(), 0});
    if (found.records == 0) {
      ++answers.uncovered;
      continue;
    }
    const double d = luminance(found.irradiance) - record_luminance(r);
    difference += d;
    squares += d * d;
    sum += record_luminance(r);
  }
  const double covered = static_cast<double>(answers.points - answers.uncovered);
  if (sum > 0) {
    answers.bias = difference / sum;
    answers.rmse = std::sqrt(squares / covered) / (sum / covered);
  }
  return answers;
}

}  // namespace

CacheDifference compare_caches(const CacheContents& a, const CacheContents& b) {
  CacheDifference result;
  const std::vector<SurfaceRecord> left = sorted_by_key(a), right = sorted_by_key(b);
  // Equal local positions are equal places only where the origins agree.
  const bool has_one_origin = a.header.origin == b.header.origin;
  Sums sums;
  for (std::size_t i = 0, j = 0; i < left.size() || j < right.size();) {
    if (j == right.size() || (i < left.size() && is_before(left[i], right[j]))) {
      ++result.only_a;
      ++i;
    } else if (i == left.size() || is_before(right[j], left[i])) {
      ++result.only_b;
      ++j;
    } else {
      const bool is_equal =
          has_one_origin && std::memcmp(&left[i], &right[j], sizeof(SurfaceRecord)) == 0;
      ++(is_equal ? result.equal : result.different);
      sums.add(left[i++], right[j++]);
    }
  }
  result.values = sums.values();
  result.answers = compare_answers(a, b);
  return result;
}

}  // namespace brume
