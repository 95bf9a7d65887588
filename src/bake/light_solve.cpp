#include "bake/light_solve.h"

#include <algorithm>

#include "core/parallel.h"

namespace brume {
namespace {

// What left-out orders may add to any record.
constexpr double kLargestRest = 1e-3;

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

// The largest ratio of two lights over records and channels; infinite where the first shines and the
// second does not.
double largest_ratio(const DeepLight& light, const DeepLight& of) {
  double most = 0;
  for (std::size_t i = 0; i < light.size(); ++i)
    for (int c = 0; c < 3; ++c)
      if (light[i][c] > 0)
        most = std::max(most, of[i][c] > 0 ? light[i][c] / of[i][c] : kInfinity);
  return most;
}

}  // namespace

SurfaceTransport::SurfaceTransport(const IrradianceCache& deep, std::vector<DeepRow>& rows,
                                   double min_radius, int threads)
    : rows_(rows.size()), threads_(threads) {
  const SurfaceRecord* first = deep.records().data();
  parallel_for(threads, rows.size(), 16, [&](std::size_t i) {
    const Vec3d receiver = vector(first[i].position) + deep.origin();
    Row& row = rows_[i];
    for (const Stratum& s : rows[i].strata) {
      const std::vector<RecordWeight> covering =
          deep.explain({kDeepLayer, s.hit(receiver), vector(s.normal), min_radius});
      if (covering.empty()) continue;
      double sum = 0;
      for (const RecordWeight& w : covering) sum += w.weight;
      for (const RecordWeight& w : covering)
        row.terms.push_back(
            {static_cast<std::uint32_t>(w.record - first), static_cast<float>(w.weight / sum)});
      Link link{{}, static_cast<std::uint32_t>(row.terms.size())};
      for (int c = 0; c < 3; ++c) link.factor[c] = s.measure * s.reflectance[c];
      row.links.push_back(link);
    }
    rows[i].strata = {};
  });
}

DeepLight SurfaceTransport::apply(const DeepLight& light) const {
  DeepLight next(rows_.size());
  parallel_for(threads_, rows_.size(), 64, [&](std::size_t i) {
    const Row& row = rows_[i];
    RgbD sum;
    std::size_t t = 0;
    for (const Link& link : row.links) {
      RgbD at_hit;
      for (; t < link.end; ++t) at_hit += light[row.terms[t].record] * double(row.terms[t].weight);
      sum += at_hit * RgbD(link.factor[0], link.factor[1], link.factor[2]);
    }
    next[i] = sum;
  });
  return next;
}

std::size_t SurfaceTransport::stratum_count() const {
  std::size_t count = 0;
  for (const Row& row : rows_) count += row.links.size();
  return count;
}

DeepSolution solve_deep_light(const SurfaceTransport& transport, const std::vector<DeepRow>& rows,
                              int bounces) {
  DeepSolution solution;
  for (const DeepRow& row : rows) solution.light.push_back(row.unreflected);
  solution.before.assign(rows.size(), RgbD());
  DeepLight change = solution.light;
  while (solution.orders < bounces - 1) {
    DeepLight next = transport.apply(change);
    const int order = ++solution.orders;
    if (order == 1)
      for (std::size_t i = 0; i < rows.size(); ++i) next[i] += rows[i].reflected;
    const double ratio = order > 1 ? largest_ratio(next, change) : kInfinity;
    change = std::move(next);
    solution.before = solution.light;
    for (std::size_t i = 0; i < rows.size(); ++i) solution.light[i] += change[i];
    if (!(ratio < 1) || order == bounces - 1) continue;
    solution.truncation_bound = ratio / (1 - ratio) * largest_ratio(change, solution.light);
    if (solution.truncation_bound < kLargestRest) return solution;
  }
  solution.truncation_bound = 0;
  return solution;
}

}  // namespace brume
