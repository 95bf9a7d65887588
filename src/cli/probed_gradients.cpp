#include "cli/probed_gradients.h"

#include <cmath>

#include "cli/outputs.h"
#include "cli/text_table.h"
#include "core/error.h"
#include "core/random.h"

namespace brume {
namespace {

RgbGradient difference_quotient(const ShiftedValue& value, std::uint64_t key,
                                const std::optional<Frame>& surface, double h) {
  const auto central = [&](const Vec3d& direction) {
    return (value(key, direction * h) - value(key, direction * -h)) / (2 * h);
  };
  if (!surface)
    return outer(central({1, 0, 0}), {1, 0, 0}) + outer(central({0, 1, 0}), {0, 1, 0}) +
           outer(central({0, 0, 1}), {0, 0, 1});
  const RgbD along_normal = (4.0 * value(key, surface->n * h) - 3.0 * value(key, Vec3d(0.0)) -
                             value(key, surface->n * (2 * h))) /
                            (2 * h);
  return outer(central(surface->u), surface->u) + outer(central(surface->v), surface->v) +
         outer(along_normal, surface->n);
}

}  // namespace

std::uint64_t probe_key(std::uint64_t seed, int repetition) {
  return random_key(seed, std::uint64_t{0x70726f6265}, repetition);
}

FiniteDifference finite_difference(const ShiftedValue& value, const std::optional<Frame>& surface,
                                   double h, std::uint64_t seed) {
  FiniteDifference result;
  std::array<RgbGradient, kNoiseSeeds> samples;
  for (int i = 0; i < kNoiseSeeds; ++i) {
    samples[i] = difference_quotient(value, probe_key(seed, i), surface, h);
    result.value += samples[i] * (1.0 / kNoiseSeeds);
  }
  for (int c = 0; c < 3; ++c)
    for (int axis = 0; axis < 3; ++axis) {
      double squares = 0;
      for (const RgbGradient& s : samples)
        squares += std::pow(s[c][axis] - result.value[c][axis], 2);
      result.noise[c][axis] = std::sqrt(squares / (kNoiseSeeds - 1) / kNoiseSeeds);
    }
  return result;
}

const GradientTerms& ProbedGradients::of(GradientMode mode) const {
  for (std::size_t m = 0; m < kGradientModes.size(); ++m)
    if (kGradientModes[m] == mode) return by_mode[m];
  throw Error(ErrorKind::Internal, "unknown gradient mode");
}

void add_gradients(Json& object, const ProbedGradients& gradients, GradientMode mode,
                   double per_metre) {
  const GradientTerms& terms = gradients.of(mode);
  object["mode"] = gradient_mode_name(mode);
  object["gradient"] = json_of(terms.sum() * per_metre);
  object["gradient_terms"] = {{"radial", json_of(terms.radial * per_metre)},
                              {"walls", json_of(terms.walls * per_metre)},
                              {"grad_sigma", json_of(terms.grad_sigma * per_metre)},
                              {"directional", json_of(terms.directional * per_metre)}};
  Json modes = Json::object();
  for (std::size_t m = 0; m < kGradientModes.size(); ++m)
    modes[gradient_mode_name(kGradientModes[m])] =
        json_of(gradients.by_mode[m].sum() * per_metre);
  object["gradient_modes"] = modes;
  if (!gradients.difference) return;
  object["finite_difference"] = json_of(gradients.difference->value * per_metre);
  object["finite_difference_noise"] = json_of(gradients.difference->noise * per_metre);
}

std::vector<std::vector<std::string>> gradient_rows(const ProbedGradients& gradients,
                                                    GradientMode mode, double per_metre) {
  const GradientTerms& terms = gradients.of(mode);
  std::vector<std::vector<std::string>> rows{{"W/m^3", "", "d/dx", "d/dy", "d/dz"}};
  add_gradient_rows(rows, std::string("gradient, ") + gradient_mode_name(mode),
                    terms.sum() * per_metre);
  add_gradient_rows(rows, "  radial", terms.radial * per_metre);
  add_gradient_rows(rows, "  walls", terms.walls * per_metre);
  add_gradient_rows(rows, "  grad_sigma", terms.grad_sigma * per_metre);
  add_gradient_rows(rows, "  directional", terms.directional * per_metre);
  if (gradients.difference) {
    add_gradient_rows(rows, "finite difference", gradients.difference->value * per_metre);
    add_gradient_rows(rows, "  its noise", gradients.difference->noise * per_metre);
  }
  for (std::size_t m = 0; m < kGradientModes.size(); ++m)
    if (kGradientModes[m] != mode && kGradientModes[m] != GradientMode::None)
      add_gradient_rows(rows, std::string("mode ") + gradient_mode_name(kGradientModes[m]),
                        gradients.by_mode[m].sum() * per_metre);
  return rows;
}

void add_gradient_rows(std::vector<std::vector<std::string>>& rows, const std::string& name,
                       const RgbGradient& g) {
  const char* const channels[] = {"R", "G", "B"};
  for (int c = 0; c < 3; ++c)
    rows.push_back({c == 0 ? name : "", channels[c], shown_number(g[c].x), shown_number(g[c].y),
                    shown_number(g[c].z)});
}

}  // namespace brume
