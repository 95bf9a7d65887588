// Gradients by differences, for probes.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "core/math.h"

namespace brume {

// Independent repetitions of finite differences and of sweeps.
inline constexpr int kNoiseSeeds = 8;

// Random numbers of one repetition.
std::uint64_t probe_key(std::uint64_t seed, int repetition);

struct FiniteDifference {
  RgbGradient value;  // Mean over seeds; both sides of a difference use the same random numbers.
  RgbGradient noise;  // Standard error of that mean.
};

// What is probed, at a shift from the probed point.
using ShiftedValue = std::function<RgbD(std::uint64_t key, const Vec3d& shift)>;

// In free space (no `surface`) by central differences over steps of h. On a surface there is no light
// behind it to compare with, so along the frame's normal a one-sided difference of second order stands in.
FiniteDifference finite_difference(const ShiftedValue& value, const std::optional<Frame>& surface,
                                   double h, std::uint64_t seed);

}  // namespace brume
