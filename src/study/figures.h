// The validation and result figures of the talk [JZJ08], from our own runs.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "study/ground_study.h"
#include "study/interpolation_study.h"
#include "study/result_study.h"

namespace brume {

struct FiguresOptions {
  std::filesystem::path folder;     // Exists. Scenes go into folders of their own below it.
  bool is_quick = false;            // Small and coarse: shows that all of it works, in seconds.
  int width_px = 0;                 // Of the result frames; 0: 1024, or 64 where quick.
  std::vector<std::string> only{};  // Names of scenes (data_gen/talk_scenes.h); empty: all.
};

// What was found out about one scene.
struct FigureScene {
  std::string name;
  std::filesystem::path file;  // The scene file.
  std::optional<GroundStudy> ground{};
  std::vector<Rgb> view{};  // Where there is a ground: the scene as its camera sees it.
  std::optional<ResultStudy> result{};
  InterpolationStudy interpolation{};
  PairedCost cost{};  // Gathers with full gradients over those with Ward-Heckbert's.
  BakeSettings settings{};
  int width = 0, height = 0;   // Of the view that was baked.
  double bake_cpu = 0;         // Seconds, with full gradients.
  double regather_change = 0;  // Largest relative change of irradiance when gathered again: 0.
};

struct FiguresReport {
  bool is_quick = false;
  std::vector<FigureScene> scenes;
  double cpu_seconds = 0;
};

// Throws Error(Usage) for an unknown name in `only`, Error(Stopped) where a stop is asked for.
FiguresReport study_figures(const FiguresOptions& options, const StudyRun& run);

}  // namespace brume
