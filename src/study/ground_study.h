// Irradiance and its gradients over a piece of flat ground, seen from above: what gradients look
// like, how far they are from the truth, and what extrapolating with them gives.
//
// Two axes along the ground: x, and z as the page's downward axis. Values are of luminance;
// gradients per world unit.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "study/study_scene.h"

namespace brume {

struct GroundOptions {
  Box3d area;                // y is the ground's height.
  int pixels = 48;           // Along each axis of the maps.
  int cells = 16;            // Theta strips of the gathers whose gradients are shown.
  int reference_cells = 32;  // Of each of the two gathers that stand for the truth of irradiance.
  double line_at = 0.5;      // Where the line of the gradient runs, as a part of the area's z.
  int line_cells = 64, line_seeds = 8;  // Of its truth.
  int records = 6;                      // Along each axis, for the pictures of extrapolation.
  std::vector<int> cell_counts{4, 8, 16, 32, 64};         // Theta strips, for convergence.
  std::vector<int> record_counts{2, 3, 4, 6, 8, 12, 16};  // Along each axis, for convergence.
  int record_cells = 32;  // Theta strips of the records whose number varies.
  int repeats = 4;        // Independent sets of records in each point of a convergence.
  std::uint64_t seed = 1;
};

// Gradients shown side by side; the last three come from the same samples.
enum class GradientSource { Differences, FineDifferences, Full, Media, WardHeckbert };
inline constexpr std::array kGradientSources{GradientSource::Differences,
                                             GradientSource::FineDifferences, GradientSource::Full,
                                             GradientSource::Media, GradientSource::WardHeckbert};
inline constexpr std::size_t kSourceCount = kGradientSources.size();
// Samples of FineDifferences over those of Differences: each gather has that many times the cells.
inline constexpr int kFineSamples = 10;

struct GradientLine {
  std::vector<double> x;
  std::vector<double> truth, truth_error;  // dE/dx, and its standard error over seeds.
  std::array<std::vector<double>, kSourceCount> gradient;
  // Rms over the line, over the rms of the truth; the truth's own noise is taken off.
  std::array<double, kSourceCount> relative_error{};
  double truth_relative_error = 0;  // The same of truth_error.
  double step_effect = 0;           // Rms change of the truth when its step is doubled, likewise.
};

struct Extrapolation {
  std::vector<double> irradiance;  // A pixel each; 0 where nobody answers.
  double relative_rms = 0;
};

struct ConvergencePoint {
  int along = 0;     // Theta strips, or records along an axis.
  double count = 0;  // Cells, or records.
  std::array<double, kModeCount> relative_rms{};
};

struct GroundStudy {
  int pixels = 0;
  GatherOptions gather, reference;                        // As used.
  std::vector<std::uint8_t> is_ground;                    // 0: something stands there.
  std::vector<double> irradiance;                         // Mean of the two reference gathers.
  std::array<std::vector<Vec2d>, kSourceCount> gradient;  // (dE/dx, dE/dz), a pixel each.
  std::array<double, kSourceCount> ms_per_pixel{};        // CPU; the last three share one gather.
  double media_share = 0;                                 // Of the irradiance, mean.
  double reference_noise = 0;  // Standard error of the reference, rms over its mean.
  GradientLine line;
  std::vector<Vec2d>
      record_sites;  // Of the records in the pictures, as parts of the area in x and z.
  std::array<Extrapolation, kModeCount> extrapolation;
  std::vector<ConvergencePoint> by_cells, by_records;
};

// Throws Error(Stopped) where a stop is asked for, Error(InvalidInput) where there is no ground.
GroundStudy study_ground(const StudyScene& scene, const GroundOptions& options,
                         const StudyRun& run);

}  // namespace brume
