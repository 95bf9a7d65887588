#include "cli/finite_difference.h"

#include <array>
#include <cmath>

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

}  // namespace brume
