#include "bake/scattering_solve.h"

#include <algorithm>
#include <cmath>

namespace brume {
namespace {

// Plain terms before convergence is called slow, and the ratio that is.
constexpr int kPlainTerms = 12;
constexpr double kSlowRatio = 0.6;
constexpr int kMostCycles = 8;
// Of GMRES between restarts, within the memory of so many numbers: it needs as many as records
// stand between a light and the far side of the medium.
constexpr std::size_t kMostSteps = 40, kLeastSteps = 12, kMostNumbers = std::size_t(8) << 20;
constexpr int kStepsBetweenChecks = 2;
// Records darker than this part of the mean need no better than it, where sums are accelerated.
constexpr double kFloor = 0.1;
// What bounds an error: plain terms of it at most, and how good it has to be.
constexpr int kMajorantTerms = 4;
constexpr double kLeastMajorant = 0.25;

double dot(const std::vector<RgbD>& a, const std::vector<RgbD>& b) {
  RgbD sum;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i] * b[i];
  return sum.r + sum.g + sum.b;
}

void add_times(const std::vector<RgbD>& what, double factor, std::vector<RgbD>& to) {
  for (std::size_t i = 0; i < to.size(); ++i) to[i] += what[i] * factor;
}

std::vector<RgbD> difference(const std::vector<RgbD>& a, const std::vector<RgbD>& b) {
  std::vector<RgbD> d(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) d[i] = a[i] - b[i];
  return d;
}

}  // namespace

ScatteringSolve::ScatteringSolve(const LightTransport& transport, int limit, double tolerance)
    : transport_(transport), limit_(limit), tolerance_(tolerance) {}

std::vector<RgbD> ScatteringSolve::sum(Light source, Light& surface) {
  if (source.empty() || limit_ <= 0) return Light(source.size());
  if (all_.empty()) all_.resize(source.size());
  Light sum = source;
  if (is_accelerated_) {
    if (!(dot(source, source) > 0)) return sum;
    // This source is nearly the last one but for its size.
    const double scale = dot(source, last_source_) / dot(last_source_, last_source_);
    sum = last_sum_;
    for (RgbD& m : sum) m *= scale;
    accelerate(source, sum, difference(source, difference(sum, transport_.scatter(sum))));
  } else if (Light term = source; !add_terms(sum, term)) {
    // What is left of the source is the first term that was not added.
    is_accelerated_ = true;
    find_majorant();
    accelerate(source, sum, std::move(term));
  }
  add_times(transport_.scatter_to_surfaces(sum), 1, surface);
  add_times(sum, 1, all_);
  return sum;
}

bool ScatteringSolve::add_terms(Light& sum, Light& term) {
  const std::size_t stride = transport_.moment_count();
  for (int order = 1;; ++order) {
    orders_ = std::max(orders_, order);
    if (order == limit_) return true;
    Light next = transport_.scatter(term);
    double ratio = 0, part = 0;
    for (std::size_t i = 0; i < sum.size(); i += stride)
      for (int c = 0; c < 3; ++c) {
        if (!(next[i][c] > 0)) continue;
        ratio = std::max(ratio, term[i][c] > 0 ? next[i][c] / term[i][c] : kInfinity);
        part = std::max(part, next[i][c] / (all_[i][c] + sum[i][c] + next[i][c]));
      }
    if (part == 0 || (ratio < 1 && part / (1 - ratio) < tolerance_)) {
      bound_ += part > 0 ? part / (1 - ratio) : 0;
      return true;
    }
    term = std::move(next);
    if (order >= kPlainTerms && ratio > kSlowRatio && limit_ > 1000 * kPlainTerms) return false;
    add_times(term, 1, sum);
  }
}

void ScatteringSolve::accelerate(const Light& source, Light& sum, Light residual) {
  const std::size_t stride = transport_.moment_count();
  const auto is_bounded = [&](const Light& light, const Light& rest) {
    return bound_of(light, rest) < tolerance_;
  };
  for (int cycle = 0; cycle < kMostCycles && !is_bounded(sum, residual); ++cycle)
    improve(sum, residual, is_bounded);
  bound_ += bound_of(sum, residual);
  last_source_ = source;
  last_sum_ = sum;
  // A residual may leave dark records a little below 0.
  for (std::size_t i = 0; i < sum.size(); i += stride)
    for (int c = 0; c < 3; ++c) sum[i][c] = std::max(0.0, sum[i][c]);
}

// Arnoldi by modified Gram-Schmidt, least squares by Givens rotations; all channels and moments are
// one vector.
void ScatteringSolve::improve(Light& light, Light& residual, const IsEnough& is_enough) {
  const auto steps = static_cast<int>(
      std::clamp(kMostNumbers / std::max<std::size_t>(1, light.size()), kLeastSteps, kMostSteps));
  const double size = std::sqrt(dot(residual, residual));
  if (!(size > 0)) return;
  std::vector<Light> basis{residual};
  for (RgbD& r : basis[0]) r *= 1 / size;
  std::vector<std::vector<double>> hessenberg, r;  // By column; r is the first's triangle.
  std::vector<double> g{size}, cosine, sine;
  for (int k = 1;; ++k) {
    Light next = difference(basis.back(), transport_.scatter(basis.back()));
    std::vector<double> column;
    for (const Light& v : basis) {
      column.push_back(dot(v, next));
      add_times(v, -column.back(), next);
    }
    const double left = std::sqrt(dot(next, next));
    column.push_back(left);
    hessenberg.push_back(column);
    for (std::size_t i = 0; i < cosine.size(); ++i) {
      const double low = column[i], high = column[i + 1];
      column[i] = cosine[i] * low + sine[i] * high;
      column[i + 1] = cosine[i] * high - sine[i] * low;
    }
    const std::size_t last = cosine.size();
    const double length = std::hypot(column[last], column[last + 1]);
    cosine.push_back(column[last] / length);
    sine.push_back(column[last + 1] / length);
    column[last] = length;
    g.push_back(-sine.back() * g.back());
    g[last] *= cosine.back();
    r.push_back(std::move(column));
    const bool is_last = k == steps || !(left > 1e-14);
    if (left > 1e-14) {
      for (RgbD& m : next) m *= 1 / left;
      basis.push_back(std::move(next));
    }
    if (!is_last && k % kStepsBetweenChecks != 0) continue;

    const std::size_t n = r.size();
    std::vector<double> y(n);
    for (std::size_t i = n; i-- > 0;) {
      double sum = g[i];
      for (std::size_t j = i + 1; j < n; ++j) sum -= r[j][i] * y[j];
      y[i] = sum / r[i][i];
    }
    Light better = light, rest(light.size());
    for (std::size_t j = 0; j < n; ++j) add_times(basis[j], y[j], better);
    // What is left lies in the same basis.
    for (std::size_t i = 0; i < basis.size(); ++i) {
      double part = i == 0 ? size : 0;
      for (std::size_t j = 0; j < n; ++j)
        if (i < hessenberg[j].size()) part -= hessenberg[j][i] * y[j];
      add_times(basis[i], part, rest);
    }
    if (!is_last && !is_enough(better, rest)) continue;
    light = std::move(better);
    residual = std::move(rest);
    return;
  }
}

// Of the response to light that arrives everywhere alike: a few plain terms where they do, else
// what GMRES makes of them.
void ScatteringSolve::find_majorant() {
  const std::size_t stride = transport_.moment_count();
  Light one(transport_.volume_count() * stride);
  for (std::size_t i = 0; i < one.size(); i += stride) one[i] = RgbD(1);
  const auto is_found = [&](const Light& majorant, const Light& rest) {
    majorant_source_ = difference(one, rest);
    double least = kInfinity;
    for (std::size_t i = 0; i < one.size(); i += stride)
      for (int c = 0; c < 3; ++c) least = std::min({least, majorant_source_[i][c], majorant[i][c]});
    return least >= kLeastMajorant;
  };
  majorant_ = one;
  Light residual = transport_.scatter(one);  // 1 - (1 - K 1).
  for (int term = 1; term < kMajorantTerms; ++term) {
    if (is_found(majorant_, residual)) return;
    add_times(residual, 1, majorant_);
    residual = transport_.scatter(residual);
  }
  for (int cycle = 0; cycle < kMostCycles; ++cycle) {
    if (is_found(majorant_, residual)) return;
    improve(majorant_, residual, is_found);
  }
  if (is_found(majorant_, residual)) return;
  // Light that never ends, as in a closed white furnace without loss: nothing bounds it.
  std::fill(majorant_.begin(), majorant_.end(), RgbD(kInfinity));
}

// A residual's radiance is at most (order + 1) times the root of its moments' squares over 4 pi,
// since sum over k of Y_k^2 is (order + 1)^2.
double ScatteringSolve::bound_of(const Light& light, const Light& residual) const {
  const std::size_t stride = transport_.moment_count();
  const double harmonics = std::sqrt(double(stride));
  double most = 0;
  for (int c = 0; c < 3; ++c) {
    double worst = 0, mean = 0;
    for (std::size_t i = 0; i < light.size(); i += stride) {
      double squares = 0;
      for (std::size_t k = 0; k < stride; ++k) squares += residual[i + k][c] * residual[i + k][c];
      worst = std::max(worst, harmonics * std::sqrt(squares) / majorant_source_[i][c]);
      mean += all_[i][c] + light[i][c];
    }
    mean *= double(stride) / double(light.size());
    if (!(mean > 0)) continue;
    for (std::size_t i = 0; i < light.size(); i += stride)
      most = std::max(most,
                      majorant_[i][c] * worst / std::max(all_[i][c] + light[i][c], kFloor * mean));
  }
  return most;
}

}  // namespace brume
