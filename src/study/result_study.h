// A finished frame with the gradients of two modes from the same records, against a path-traced
// one.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "render/film.h"
#include "study/regradient.h"

namespace brume {

struct ResultOptions {
  BakeView view;
  int samples = 8;        // A pixel, of the cached frames.
  int path_samples = 32;  // A pixel, of each of the two halves of the path-traced frame.
  int block = 16;         // Errors are of means over this many pixels squared.
};

inline constexpr std::array kResultModes{GradientMode::Full, GradientMode::WardHeckbert};

struct ResultFrame {
  std::vector<Rgb> beauty;
  double render_cpu = 0;     // Seconds.
  std::vector<float> error;  // Of indirect light, a block each, over the reference's mean; signed.
  double relative_rms = 0;   // Of the blocks, over the mean; the reference's noise is taken off.
  double signed_mean = 0;
};

struct ResultStudy {
  int width = 0, height = 0;
  int blocks_x = 0, blocks_y = 0;
  std::array<ResultFrame, kResultModes.size()> frames;  // In kResultModes' order.
  std::vector<Rgb> reference;                           // Beauty.
  double path_cpu = 0;
  int path_samples = 0;        // A pixel, both halves together.
  double reference_noise = 0;  // Of the blocks of the reference's mean, rms, over its mean.
};

// A frame by the cached integrator.
PixelFilm render_view(const StudyScene& scene, const IrradianceCache& cache, const BakeView& view,
                      int samples, const std::string& stage, const StudyRun& run);
std::vector<Rgb> beauty_of(const PixelFilm& film);

// `caches` as for study_interpolation(); the frames are those of the cached integrator, the
// reference samples exactly its paths.
ResultStudy study_result(const StudyScene& scene, const IrradianceCache& cache,
                         const RegradientResult& caches, const ResultOptions& options,
                         const StudyRun& run);

}  // namespace brume
