// Whether a cache's answers are true: at a few points of what asks, through the picture's own
// query, against paths that share no code and no records with it.
#pragma once

#include <cstdint>
#include <vector>

#include "bake/bake.h"

namespace brume {

// Where irradiance is asked for.
struct AskedPoint {
  Hit hit;
  Vec3d normal{0.0};  // On the side that receives.
  double footprint = 0;
};

// `count` points of what the request asks for, spread evenly: over its views' pixels, or over all
// surfaces by area, either side. Fewer where views see fewer surfaces that reflect.
std::vector<AskedPoint> asked_points(const World& world, const BakeRequest& request, int count,
                                     std::uint64_t seed);

inline constexpr int kCheckedPoints = 64;

// Of irradiance's luminance. Relative numbers are over the mean of the truths or of the answers,
// whichever is larger, so that light where none should be counts. What the paths are off themselves
// is taken out of squares by two independent halves.
struct AnswerCheck {
  int points = 0, gathered = 0;  // Of the points, those that no record answered.
  double truth = 0, answer = 0;  // Means.
  double bias = 0, bias_error = 0;
  double rmse = 0, rmse_low = 0,
         rmse_high = 0;  // Two standard errors of its square to either side.
  // The one that is surely farthest off, and by how much.
  Vec3d worst_position{0.0};
  double worst_truth = 0, worst_truth_error = 0, worst_answer = 0;
  int paths = 0;  // At each point.
  double seconds = 0;

  // Farther off than paths and chance explain: a bias above 3 %, or an RMSE above a tenth.
  bool is_doubtful() const;
};

// A pure function of its arguments but for the seconds. Takes 2 CPU seconds, or a twentieth of what
// gathering the cache's records took where that is less (a tenth of a second at least), besides
// gathers where no record answers.
AnswerCheck check_answers(const Lighting& lighting, const BakeSettings& settings,
                          const IrradianceCache& cache, const std::vector<AskedPoint>& points,
                          int threads, const Scattered& scattered = nullptr);

}  // namespace brume
