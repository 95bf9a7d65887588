#include "bake/light_solve.h"

#include <algorithm>

#include "bake/scattering_solve.h"

namespace brume {
namespace {

// What left-out orders may add to any record. Half of it is for scatterings that are left out, in
// so many bounces at most: those that matter. Without surfaces they are summed once.
constexpr double kLargestRest = 1e-3;
constexpr int kMostBounces = 10;

using Light = std::vector<RgbD>;

Light known(const std::vector<DeepRow>& rows, std::vector<RgbD> DeepRow::*of) {
  Light all;
  for (const DeepRow& row : rows) all.insert(all.end(), (row.*of).begin(), (row.*of).end());
  return all;
}

void add(const Light& what, Light& to) {
  for (std::size_t i = 0; i < to.size(); ++i) to[i] += what[i];
}

// The largest ratio of two lights over records and channels; infinite where the first shines and
// the second does not. Every `stride`-th number is one that is never negative.
double largest_ratio(const Light& light, const Light& of, std::size_t stride) {
  double most = 0;
  for (std::size_t i = 0; i < light.size(); i += stride)
    for (int c = 0; c < 3; ++c)
      if (light[i][c] > 0) most = std::max(most, of[i][c] > 0 ? light[i][c] / of[i][c] : kInfinity);
  return most;
}

double sum_of(const DeepLight& light, std::size_t stride) {
  double sum = 0;
  for (const RgbD& e : light.surface) sum += mean_component(e);
  for (std::size_t i = 0; i < light.volume.size(); i += stride)
    sum += mean_component(light.volume[i]);
  return sum;
}

}  // namespace

DeepSolution solve_deep_light(const LightTransport& transport,
                              const std::vector<DeepRow>& surface_rows,
                              const std::vector<DeepRow>& volume_rows, int bounces,
                              int volume_bounces) {
  const std::size_t stride = transport.moment_count();
  const int sums = surface_rows.empty() ? 1 : std::min(bounces + 1, kMostBounces);
  ScatteringSolve scattering(transport, volume_bounces - 1, kLargestRest / 2 / sums);
  DeepSolution solution;
  DeepLight& light = solution.light;
  const auto ratio_of = [&](const DeepLight& a, const DeepLight& b) {
    return std::max(largest_ratio(a.surface, b.surface, 1),
                    largest_ratio(a.volume, b.volume, stride));
  };

  // What met no surface.
  DeepLight change;
  change.surface = known(surface_rows, &DeepRow::unreflected);
  change.volume = scattering.sum(known(volume_rows, &DeepRow::unreflected), change.surface);
  light = change;
  solution.before.assign(surface_rows.size(), RgbD());
  // Light of the last reflection is only asked for in the medium.
  const int last = volume_rows.empty() ? bounces - 1 : bounces;
  for (int order = 1; order <= last; ++order) {
    DeepLight next = transport.reflect(change.surface);
    if (order == 1) {
      add(known(surface_rows, &DeepRow::reflected), next.surface);
      add(known(volume_rows, &DeepRow::reflected), next.volume);
    }
    next.volume = scattering.sum(std::move(next.volume), next.surface);
    const double ratio = order > 1 ? ratio_of(next, change) : kInfinity;
    const double before = sum_of(change, stride);
    change = std::move(next);
    solution.ratio = before > 0 ? sum_of(change, stride) / before : 0;
    add(change.volume, light.volume);
    if (order == bounces) break;
    solution.orders = order;
    solution.before = light.surface;
    add(change.surface, light.surface);
    const double all = sum_of(light, stride);
    solution.changes.push_back(all > 0 ? sum_of(change, stride) / all : 0);
    if (!(ratio < 1) || order == last) continue;
    const double bound = ratio / (1 - ratio) * ratio_of(change, light);
    if (bound + scattering.bound() >= kLargestRest) continue;
    solution.truncation_bound = bound;
    break;
  }
  solution.scatterings = scattering.orders();
  solution.is_accelerated = scattering.is_accelerated();
  solution.truncation_bound += scattering.bound();
  solution.reflected_fluence.assign(volume_rows.size(), RgbD());
  if (bounces > 0 && !volume_rows.empty()) {
    const std::vector<RgbD> reflected = transport.reflect(light.surface).volume;
    for (std::size_t i = 0; i < volume_rows.size(); ++i)
      solution.reflected_fluence[i] = reflected[i * stride] + volume_rows[i].reflected[0];
  }
  solution.applications = transport.applications();
  solution.strata = transport.stratum_count();
  return solution;
}

}  // namespace brume
