// A scene made ready for many gathers, and the gathers themselves, in all gradient modes from the
// same samples.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "bake/bake.h"
#include "bake/scene_settings.h"
#include "study/study_run.h"

namespace brume {

inline constexpr std::size_t kModeCount = kGradientModes.size();

// Not movable: its parts refer to each other.
class StudyScene {
 public:
  StudyScene(Scene scene, const BakeSettings& settings, const StudyRun& run);
  StudyScene(const StudyScene&) = delete;
  StudyScene& operator=(const StudyScene&) = delete;

  const Scene& scene() const { return scene_; }
  const World& world() const { return world_; }
  const BakeSettings& settings() const { return settings_; }
  const Lighting& lighting() const { return lighting_; }
  const Effects& effects() const { return effects_; }

 private:
  Scene scene_;
  World world_;
  BakeSettings settings_;
  Lighting lighting_;
  Effects effects_;
};

struct PointGather {
  RgbD irradiance;
  double media_share = 0;                          // Of the luminance.
  std::array<RgbGradient, kModeCount> gradient{};  // In kGradientModes' order.
  RgbGradient rotational;
};

// In the order of `points`. Without gradients where options.gradient is None, else of all modes.
std::vector<PointGather> gather_points(const StudyScene& scene, const GatherOptions& options,
                                       const HitLight& light,
                                       const std::vector<GatherPoint>& points,
                                       const std::string& stage, const StudyRun& run);

// M strips and about pi M sectors, so that cells are about square (gradients.md 1).
GatherOptions with_cells(GatherOptions options, int cells_theta);

// Throws Error(Stopped) where a stop was asked for.
BakeResult bake_layers_below(const StudyScene& scene, const std::string& stage,
                             const StudyRun& run);

// Mean squared errors against a reference that is known twice, by two independent estimates of
// equal quality: the product of both differences is free of the reference's own noise in the mean.
class NoiseFreeError {
 public:
  void add(double value, double first, double second);
  // mean((a-b)^2 / (b^2 + (0.01 mean(b))^2)), b the reference (SPEC, relMSE); may be below 0 by
  // noise.
  double relmse() const;
  // Root of the mean squared error over the mean reference; 0 where noise makes the mean negative.
  double relative_rms() const;
  // Standard error of the mean of the two estimates, rms, over the mean reference.
  double reference_noise() const;

 private:
  double mean_reference() const;
  std::vector<std::array<double, 3>> samples_;  // Value, first, second.
};

}  // namespace brume
