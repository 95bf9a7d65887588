#include "study/result_study.h"

#include <algorithm>

#include "core/random.h"
#include "render/cached_renderer.h"
#include "render/path_tracer.h"

namespace brume {
namespace {

// The records of one mode above the layers below, as a bake would have left them.
IrradianceCache with_deeper_layers(const IrradianceCache& top, const IrradianceCache& all,
                                   int layer) {
  std::vector<SurfaceRecord> records(top.records().begin(), top.records().end());
  for (const SurfaceRecord& r : all.records())
    if (r.layer() != layer) records.push_back(r);
  return {std::move(records), all.origin()};
}

class ResultRun {
 public:
  ResultRun(const StudyScene& scene, const ResultOptions& options, const StudyRun& run)
      : scene_(scene),
        options_(options),
        run_(run),
        rays_(options.view.camera, options.view.width, options.view.height) {
    study_.width = options.view.width;
    study_.height = options.view.height;
    study_.blocks_x = std::max(1, study_.width / options.block);
    study_.blocks_y = std::max(1, study_.height / options.block);
  }

  ResultStudy run(const IrradianceCache& cache, const RegradientResult& caches);

 private:
  void trace_reference();
  void render(std::size_t mode, const IrradianceCache& cache);
  void compare(ResultFrame& frame, const PixelFilm& film) const;
  // Mean luminance of indirect light at surfaces, a block each.
  std::vector<double> blocks(const PixelFilm& film) const;

  const StudyScene& scene_;
  const ResultOptions& options_;
  const StudyRun& run_;
  CameraRays rays_;
  std::array<std::vector<double>, 2> reference_;  // Blocks of each half.
  ResultStudy study_;
};

std::vector<double> ResultRun::blocks(const PixelFilm& film) const {
  const int size = std::min(options_.block, std::min(study_.width, study_.height));
  std::vector<double> means;
  for (int by = 0; by < study_.blocks_y; ++by)
    for (int bx = 0; bx < study_.blocks_x; ++bx) {
      double sum = 0;
      for (int y = by * size; y < (by + 1) * size; ++y)
        for (int x = bx * size; x < (bx + 1) * size; ++x)
          sum += luminance(film.at(x, y)[Layer::DiffuseIndirect]);
      means.push_back(sum / (size * size));
    }
  return means;
}

void ResultRun::trace_reference() {
  const double start = process_cpu_seconds();
  for (std::size_t half = 0; half < 2; ++half) {
    PathTracerOptions path;
    path.transport = Transport::Cached;
    path.bounces = scene_.settings().bounces;
    path.volume_bounces = scene_.settings().volume_bounces;
    path.seed = random_key(scene_.settings().seed, std::uint64_t{0x70617468}, half);
    path.threads = run_.threads;
    path.samples = options_.path_samples;
    path.stop_requested = run_.stop_requested;
    if (run_.progress)
      path.progress = [&](double fraction) {
        run_.progress("path-traced reference", 0.5 * (double(half) + fraction));
      };
    PixelFilm film(study_.width, study_.height);
    study_.path_samples += trace_paths(scene_.world(), rays_, path, film).samples;
    run_.check_stop();
    reference_[half] = blocks(film);
    const std::vector<Rgb> image = beauty_of(film);
    if (half == 0) {
      study_.reference = image;
    } else {
      for (std::size_t i = 0; i < image.size(); ++i)
        study_.reference[i] = (study_.reference[i] + image[i]) * 0.5f;
    }
  }
  study_.path_cpu = process_cpu_seconds() - start;
  NoiseFreeError own;
  for (std::size_t i = 0; i < reference_[0].size(); ++i)
    own.add(0, reference_[0][i], reference_[1][i]);
  study_.reference_noise = own.reference_noise();
}

void ResultRun::compare(ResultFrame& frame, const PixelFilm& film) const {
  const std::vector<double> values = blocks(film);
  NoiseFreeError error;
  double sum = 0, reference_sum = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    error.add(values[i], reference_[0][i], reference_[1][i]);
    sum += values[i];
    reference_sum += 0.5 * (reference_[0][i] + reference_[1][i]);
  }
  const double mean = reference_sum / double(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double difference = values[i] - 0.5 * (reference_[0][i] + reference_[1][i]);
    frame.error.push_back(mean > 0 ? static_cast<float>(difference / mean) : 0.0f);
  }
  frame.relative_rms = error.relative_rms();
  frame.signed_mean = reference_sum > 0 ? sum / reference_sum - 1 : 0;
}

void ResultRun::render(std::size_t mode, const IrradianceCache& cache) {
  const double start = process_cpu_seconds();
  const PixelFilm film =
      render_view(scene_, cache, options_.view, options_.samples,
                  std::string("frame, ") + gradient_mode_name(kResultModes[mode]), run_);
  ResultFrame& frame = study_.frames[mode];
  frame.render_cpu = process_cpu_seconds() - start;
  frame.beauty = beauty_of(film);
  compare(frame, film);
}

ResultStudy ResultRun::run(const IrradianceCache& cache, const RegradientResult& caches) {
  trace_reference();
  for (std::size_t mode = 0; mode < kResultModes.size(); ++mode) {
    const auto m = static_cast<std::size_t>(
        std::find(kGradientModes.begin(), kGradientModes.end(), kResultModes[mode]) -
        kGradientModes.begin());
    render(mode, with_deeper_layers(caches.caches[m], cache, kTopLayer));
  }
  return std::move(study_);
}

}  // namespace

PixelFilm render_view(const StudyScene& scene, const IrradianceCache& cache, const BakeView& view,
                      int samples, const std::string& stage, const StudyRun& run) {
  CachedRenderOptions options;
  options.samples = samples;
  options.threads = run.threads;
  options.stop_requested = run.stop_requested;
  if (run.progress) options.progress = [&](double fraction) { run.progress(stage, fraction); };
  const CameraRays rays(view.camera, view.width, view.height);
  PixelFilm film(view.width, view.height);
  render_cached(scene.lighting(), scene.settings(), cache, rays, options, film);
  run.check_stop();
  return film;
}

std::vector<Rgb> beauty_of(const PixelFilm& film) {
  std::vector<Rgb> image;
  image.reserve(std::size_t(film.width()) * film.height());
  for (int y = 0; y < film.height(); ++y)
    for (int x = 0; x < film.width(); ++x) image.push_back(Rgb(film.at(x, y).beauty()));
  return image;
}

ResultStudy study_result(const StudyScene& scene, const IrradianceCache& cache,
                         const RegradientResult& caches, const ResultOptions& options,
                         const StudyRun& run) {
  return ResultRun(scene, options, run).run(cache, caches);
}

}  // namespace brume
