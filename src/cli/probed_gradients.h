// The gradients of a probe: of every mode, term by term, and by differences.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cli/statistics.h"
#include "gather/gather.h"

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

struct ProbedGradients {
  std::array<GradientTerms, kGradientModes.size()> by_mode;  // As kGradientModes; per world unit.
  std::optional<FiniteDifference> difference;

  const GradientTerms& of(GradientMode mode) const;
};

// Keys mode, gradient, gradient_terms, gradient_modes and finite_difference (SPEC).
void add_gradients(Json& object, const ProbedGradients& gradients, GradientMode mode,
                   double per_metre);

// Rows of a table: first `mode` and its terms, then differences and the other modes.
std::vector<std::vector<std::string>> gradient_rows(const ProbedGradients& gradients,
                                                    GradientMode mode, double per_metre);
// One for each channel, the first with the name.
void add_gradient_rows(std::vector<std::vector<std::string>>& rows, const std::string& name,
                       const RgbGradient& g);

}  // namespace brume
