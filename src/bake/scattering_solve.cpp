#include "bake/scattering_solve.h"

#include <algorithm>
#include <cmath>

namespace brume {
namespace {

// Plain terms before convergence is called slow, and the ratio that is.
constexpr int kPlainTerms = 12;
constexpr double kSlowRatio = 0.6;
constexpr int kMostCycles = 8;
// Of GMRES between restarts, within the memory of so many numbers: it needs as many as records stand
// between a light and the far side of the medium.
constexpr std::size_t kMostSteps = 40, kLeastSteps = 12, kMostNumbers = std::size_t(8) << 20;
// Records darker than this part of the mean need no better than it, where sums are accelerated.
constexpr double kFloor = 0.1;
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

DeepLight ScatteringSolve::applied(const Light& light) {
  DeepLight in;
  in.volume = light;
  return transport_.scatter(in);
}

std::vector<RgbD> ScatteringSolve::sum(Light source, Light& surface) {
  if (source.empty() || limit_ <= 0) return Light(source.size());
  const std::size_t stride = transport_.moment_count();
  if (all_.empty()) all_.resize(source.size());
  const Light surface_before = surface;
  Light sum = source, term = source;
  for (int order = 1;; ++order) {
    DeepLight next = applied(term);
    add_times(next.surface, 1, surface);
    orders_ = std::max(orders_, order);
    if (order == limit_) {
      finish(sum, 0);
      return sum;
    }
    double ratio = 0, part = 0;
    for (std::size_t i = 0; i < sum.size(); i += stride)
      for (int c = 0; c < 3; ++c) {
        if (!(next.volume[i][c] > 0)) continue;
        ratio = std::max(ratio, term[i][c] > 0 ? next.volume[i][c] / term[i][c] : kInfinity);
        part = std::max(part, next.volume[i][c] / (all_[i][c] + sum[i][c] + next.volume[i][c]));
      }
    if (part == 0 || (ratio < 1 && part / (1 - ratio) < tolerance_)) {
      finish(sum, part > 0 ? part / (1 - ratio) : 0);
      return sum;
    }
    if (order >= kPlainTerms && ratio > kSlowRatio && limit_ > 1000 * kPlainTerms) break;
    term = std::move(next.volume);
    add_times(term, 1, sum);
  }

  is_accelerated_ = true;
  surface = surface_before;
  if (majorant_.empty()) find_majorant();
  if (!last_sum_.empty()) {
    // The next source is nearly the last one but for its size.
    const double scale = dot(source, last_source_) / dot(last_source_, last_source_);
    sum = last_sum_;
    for (RgbD& m : sum) m *= scale;
  }
  Light residual = difference(source, difference(sum, applied(sum).volume));
  for (int cycle = 0; cycle < kMostCycles && bound_of(sum, residual) >= tolerance_; ++cycle)
    residual = improve(sum, std::move(residual));
  const double bound = bound_of(sum, residual);
  // A residual may leave dark records a little below 0.
  for (std::size_t i = 0; i < sum.size(); i += stride)
    for (int c = 0; c < 3; ++c) sum[i][c] = std::max(0.0, sum[i][c]);
  add_times(applied(sum).surface, 1, surface);
  last_source_ = std::move(source);
  last_sum_ = sum;
  finish(sum, bound);
  return sum;
}

void ScatteringSolve::finish(const Light& sum, double bound) {
  add_times(sum, 1, all_);
  bound_ += bound;
}

// Arnoldi by modified Gram-Schmidt, least squares by Givens rotations; all channels and moments are one
// vector.
ScatteringSolve::Light ScatteringSolve::improve(Light& light, Light residual) {
  const auto steps = static_cast<int>(
      std::clamp(kMostNumbers / std::max<std::size_t>(1, light.size()), kLeastSteps, kMostSteps));
  const double size = std::sqrt(dot(residual, residual));
  if (!(size > 0)) return residual;
  for (RgbD& r : residual) r *= 1 / size;
  std::vector<Light> basis{std::move(residual)};
  std::vector<std::vector<double>> hessenberg;  // By column.
  for (int k = 0; k < steps; ++k) {
    Light next = difference(basis.back(), applied(basis.back()).volume);
    std::vector<double> column;
    for (const Light& v : basis) {
      column.push_back(dot(v, next));
      add_times(v, -column.back(), next);
    }
    column.push_back(std::sqrt(dot(next, next)));
    hessenberg.push_back(column);
    if (!(column.back() > 1e-14)) break;
    for (RgbD& m : next) m *= 1 / column.back();
    basis.push_back(std::move(next));
  }
  const std::size_t n = hessenberg.size();
  std::vector<std::vector<double>> r = hessenberg;
  std::vector<double> g{size}, y, cosine, sine;
  for (std::size_t k = 0; k < n; ++k) {
    for (std::size_t i = 0; i < k; ++i) {
      const double low = r[k][i], high = r[k][i + 1];
      r[k][i] = cosine[i] * low + sine[i] * high;
      r[k][i + 1] = cosine[i] * high - sine[i] * low;
    }
    const double length = std::hypot(r[k][k], r[k][k + 1]);
    cosine.push_back(r[k][k] / length);
    sine.push_back(r[k][k + 1] / length);
    r[k][k] = length;
    g.push_back(-sine[k] * g[k]);
    g[k] *= cosine[k];
  }
  y.resize(n);
  for (std::size_t i = n; i-- > 0;) {
    double sum = g[i];
    for (std::size_t k = i + 1; k < n; ++k) sum -= r[k][i] * y[k];
    y[i] = sum / r[i][i];
  }
  for (std::size_t k = 0; k < n; ++k) add_times(basis[k], y[k], light);
  // What is left lies in the same basis.
  Light rest(light.size());
  for (std::size_t i = 0; i < basis.size(); ++i) {
    double left = i == 0 ? size : 0;
    for (std::size_t k = 0; k < n; ++k)
      if (i < hessenberg[k].size()) left -= hessenberg[k][i] * y[k];
    add_times(basis[i], left, rest);
  }
  return rest;
}

// Of the response to light that arrives everywhere alike.
void ScatteringSolve::find_majorant() {
  const std::size_t stride = transport_.moment_count();
  Light one(transport_.volume_count() * stride);
  for (std::size_t i = 0; i < one.size(); i += stride) one[i] = RgbD(1);
  majorant_ = one;
  Light residual = applied(one).volume;  // 1 - (1 - K 1).
  for (int cycle = 0; cycle < kMostCycles; ++cycle) {
    residual = improve(majorant_, std::move(residual));
    majorant_source_ = difference(one, residual);
    double least = kInfinity;
    for (std::size_t i = 0; i < one.size(); i += stride)
      for (int c = 0; c < 3; ++c)
        least = std::min({least, majorant_source_[i][c], majorant_[i][c]});
    if (least >= kLeastMajorant) return;
  }
  // Light that never ends, as in a closed white furnace without loss: nothing bounds it.
  std::fill(majorant_.begin(), majorant_.end(), RgbD(kInfinity));
}

// A residual's radiance is at most (order + 1) times the root of its moments' squares over 4 pi, since
// sum over k of Y_k^2 is (order + 1)^2.
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
      most = std::max(most, majorant_[i][c] * worst / std::max(all_[i][c] + light[i][c], kFloor * mean));
  }
  return most;
}

}  // namespace brume
