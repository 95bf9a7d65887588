#include "study/figures.h"

#include <algorithm>

#include "core/error.h"
#include "data_gen/talk_scenes.h"
#include "scene/scene_file.h"

namespace brume {
namespace {

// How much is done: for a page to be read, or to show in seconds that all of it works.
struct Extent {
  int ground_view_width, result_width;
  int resolution;
  GroundOptions ground;
  InterpolationOptions interpolation;
  ResultOptions result;
  std::size_t cost_gathers;
};

Extent extent_of(bool is_quick) {
  Extent full{512, 1024, 96, {}, {}, {}, 1500};
  // Past the block, through what hides the light and what does not.
  full.ground.line_at = 0.7;
  if (!is_quick) return full;
  Extent quick{64, 64, 16, {}, {}, {}, 45};
  GroundOptions& g = quick.ground;
  g.line_at = full.ground.line_at;
  g.pixels = 12;
  g.cells = 6;
  g.reference_cells = 10;
  g.line_cells = 12;
  g.line_seeds = 3;
  g.records = 4;
  g.cell_counts = {4, 8, 12};
  g.record_counts = {2, 4, 6};
  g.record_cells = 12;
  g.repeats = 1;
  quick.interpolation.points = 100;
  quick.interpolation.least_stride = 1;
  quick.interpolation.reference_cells = 10;
  quick.result.samples = 2;
  quick.result.path_samples = 4;
  quick.result.block = 8;
  return quick;
}

bool has_ground(const std::string& name) {
  return name == "absorbing" || name == "scattering" || name == "no-walls";
}

BakeSettings figure_settings(const RenderSettings& render, bool is_quick) {
  BakeSettings settings = settings_of(render);
  if (!is_quick) return settings;
  settings.gather.cells_theta = 6;
  settings.gather.cells_phi = 19;
  settings.bounces = std::min(settings.bounces, 1);
  settings.error = 0.4;
  return settings;
}

class FigureMaker {
 public:
  FigureMaker(const FiguresOptions& options, const StudyRun& run)
      : options_(options), run_(run), extent_(extent_of(options.is_quick)) {}

  FigureScene make(const std::string& name) const;

 private:
  // Stages carry the scene's name.
  StudyRun run_of(const std::string& name) const {
    StudyRun run = run_;
    if (run_.progress)
      run.progress = [this, name](const std::string& stage, double fraction) {
        run_.progress(name + ": " + stage, fraction);
      };
    return run;
  }
  Scene load(const std::string& name, FigureScene& figure) const;

  const FiguresOptions& options_;
  const StudyRun& run_;
  Extent extent_;
};

Scene FigureMaker::load(const std::string& name, FigureScene& figure) const {
  const std::filesystem::path folder = options_.folder / "scenes" / name;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    throw Error(ErrorKind::Resource, printable(folder.string()) + ": cannot make the folder: " +
                                         error.message() + ": choose one that can be written");
  TalkSceneOptions scene;
  scene.size_px = has_ground(name)        ? extent_.ground_view_width
                  : options_.width_px > 0 ? options_.width_px
                                          : extent_.result_width;
  scene.resolution = extent_.resolution;
  scene.threads = run_.threads;
  if (options_.is_quick && name == "disco") scene.detail = 2;
  figure.file = write_talk_scene(name, folder, scene).front();
  return load_scene(figure.file, {});
}

FigureScene FigureMaker::make(const std::string& name) const {
  const StudyRun run = run_of(name);
  FigureScene figure;
  figure.name = name;
  Scene loaded = load(name, figure);
  figure.settings = figure_settings(loaded.render, options_.is_quick);
  figure.width = loaded.film.width;
  figure.height = loaded.film.height;
  const BakeView view{"", loaded.find_camera(""), figure.width, figure.height};
  const StudyScene scene(std::move(loaded), figure.settings, run);

  if (has_ground(name)) {
    GroundOptions ground = extent_.ground;
    ground.area = talk_ground();
    figure.ground = study_ground(scene, ground, run);
  }

  BakeRequest request;
  request.views = {view};
  request.threads = run.threads;
  request.progress = run.progress;
  request.stop_requested = run.stop_requested;
  const double start = process_cpu_seconds();
  const BakeResult baked = bake(scene.lighting(), figure.settings, request, nullptr);
  run.check_stop();
  figure.bake_cpu = process_cpu_seconds() - start;

  const RegradientResult caches = regradient(scene, *baked.cache, run);
  figure.regather_change = caches.largest_change;
  figure.cost = compare_gather_cost(scene, *baked.cache, GradientMode::Full,
                                    GradientMode::WardHeckbert, extent_.cost_gathers, run);
  InterpolationOptions interpolation = extent_.interpolation;
  interpolation.view = view;
  figure.interpolation = study_interpolation(scene, *baked.cache, caches, interpolation, run);
  if (has_ground(name)) {
    figure.view =
        beauty_of(render_view(scene, *baked.cache, view, extent_.result.samples, "the scene", run));
  } else {
    ResultOptions result = extent_.result;
    result.view = view;
    figure.result = study_result(scene, *baked.cache, caches, result, run);
  }
  return figure;
}

}  // namespace

FiguresReport study_figures(const FiguresOptions& options, const StudyRun& run) {
  const std::vector<std::string>& names = talk_scene_names();
  for (const std::string& asked : options.only)
    if (std::find(names.begin(), names.end(), asked) == names.end()) {
      std::string all;
      for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
      throw Error(ErrorKind::Usage,
                  "--only: no scene is named '" + printable(asked) + "': choose from " + all);
    }
  FiguresReport report;
  report.is_quick = options.is_quick;
  const double start = process_cpu_seconds();
  const FigureMaker maker(options, run);
  for (const std::string& name : names) {
    const auto& only = options.only;
    if (!only.empty() && std::find(only.begin(), only.end(), name) == only.end()) continue;
    report.scenes.push_back(maker.make(name));
  }
  report.cpu_seconds = process_cpu_seconds() - start;
  return report;
}

}  // namespace brume
