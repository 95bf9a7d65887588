#include "study/ground_study.h"

#include <algorithm>

#include "core/error.h"
#include "core/random.h"
#include "study/ground_plane.h"

namespace brume {
namespace {

// What random numbers are for; equal numbers at both ends of a difference come from equal keys.
enum KeyUse : std::uint64_t { kMaps = 1, kFirst, kSecond, kLine, kRecords };

// Ends of the central differences over a pixel, in pixels.
const std::array kPixelSteps{Vec2d(0.5, 0), Vec2d(-0.5, 0), Vec2d(0, 0.5), Vec2d(0, -0.5)};

struct Reference {
  std::vector<double> first, second;  // A pixel each.
};

class GroundRun {
 public:
  GroundRun(const StudyScene& scene, const GroundOptions& options, const StudyRun& run)
      : scene_(scene),
        options_(options),
        run_(run),
        ground_(scene, options.area),
        deeper_(bake_layers_below(scene, "light below", run)),
        light_(light_below(*deeper_.cache, scene.settings(), scene.world(), run.threads)) {}

  GroundStudy run();

 private:
  std::uint64_t key(KeyUse use, std::uint64_t i, std::uint64_t j = 0) const {
    return random_key(options_.seed, std::uint64_t{0x67726f756e64}, use, i, j);
  }
  GatherOptions gather_options(int cells, GradientMode mode) const {
    GatherOptions g = with_cells(scene_.settings().gather, cells);
    g.gradient = mode;
    return g;
  }
  std::vector<PointGather> gather(const GatherOptions& options,
                                  const std::vector<GatherPoint>& points,
                                  const std::string& stage) const {
    return gather_points(scene_, options, light_, points, stage, run_);
  }
  // The pixel's middle moved by (dx, dz) pixels.
  std::optional<GatherPoint> pixel_point(std::size_t pixel, double dx, double dz, KeyUse use) const;
  double pitch() const { return options_.area.size().x / options_.pixels; }

  void find_ground();
  void reference();
  void gradients();
  void differences(GradientSource source, const GatherOptions& gather);
  void line();
  void line_truth(const std::vector<double>& x, double z);
  void extrapolations();
  double extrapolate(const IrradianceCache& cache, std::vector<double>* irradiance) const;
  ConvergencePoint convergence(int along, int cells) const;
  void convergences();

  const StudyScene& scene_;
  const GroundOptions& options_;
  const StudyRun& run_;
  GroundPlane ground_;
  BakeResult deeper_;
  HitLight light_;
  std::vector<std::size_t> pixels_;  // Of the ground, in order.
  Reference reference_;
  GroundStudy study_;
};

std::optional<GatherPoint> GroundRun::pixel_point(std::size_t pixel, double dx, double dz,
                                                  KeyUse use) const {
  const auto n = static_cast<std::size_t>(options_.pixels);
  return ground_.at(ground_.x((double(pixel % n) + 0.5 + dx) / options_.pixels),
                    ground_.z((double(pixel / n) + 0.5 + dz) / options_.pixels), key(use, pixel));
}

void GroundRun::find_ground() {
  const auto n = static_cast<std::size_t>(options_.pixels);
  study_.is_ground.assign(n * n, 0);
  for (std::size_t i = 0; i < n * n; ++i) {
    // With the ends of its differences, or those would look inside of what stands there.
    bool is_ground = true;
    for (const Vec2d& d : kPixelSteps) is_ground = is_ground && pixel_point(i, d.x, d.y, kMaps);
    if (!is_ground || !pixel_point(i, 0, 0, kMaps)) continue;
    study_.is_ground[i] = 1;
    pixels_.push_back(i);
  }
  if (pixels_.empty())
    throw Error(ErrorKind::InvalidInput, printable(scene_.scene().file.string()) +
                                             ": no ground faces up where the figure is to be: "
                                             "choose another area");
}

void GroundRun::reference() {
  study_.reference = gather_options(options_.reference_cells, GradientMode::None);
  study_.irradiance.assign(study_.is_ground.size(), 0);
  for (std::vector<double>* half : {&reference_.first, &reference_.second}) {
    std::vector<GatherPoint> points;
    for (const std::size_t i : pixels_)
      points.push_back(*pixel_point(i, 0, 0, half == &reference_.first ? kFirst : kSecond));
    const auto gathers = gather(study_.reference, points, "converged irradiance");
    half->assign(study_.is_ground.size(), 0);
    double media = 0;
    for (std::size_t k = 0; k < pixels_.size(); ++k) {
      (*half)[pixels_[k]] = luminance(gathers[k].irradiance);
      study_.irradiance[pixels_[k]] += 0.5 * luminance(gathers[k].irradiance);
      media += gathers[k].media_share;
    }
    study_.media_share += 0.5 * media / double(pixels_.size());
  }
  NoiseFreeError own;
  for (const std::size_t i : pixels_)
    own.add(study_.irradiance[i], reference_.first[i], reference_.second[i]);
  study_.reference_noise = own.reference_noise();
}

// Central differences over a pixel, with the same random numbers at both ends.
void GroundRun::differences(GradientSource source, const GatherOptions& options) {
  const auto s = static_cast<std::size_t>(source);
  std::vector<GatherPoint> points;
  for (const std::size_t i : pixels_)
    for (const Vec2d& d : kPixelSteps) points.push_back(*pixel_point(i, d.x, d.y, kMaps));
  const double start = process_cpu_seconds();
  const auto gathers = gather(options, points, "finite differences");
  study_.ms_per_pixel[s] = 1e3 * (process_cpu_seconds() - start) / double(pixels_.size());
  study_.gradient[s].assign(study_.is_ground.size(), Vec2d(0.0));
  for (std::size_t k = 0; k < pixels_.size(); ++k) {
    const auto e = [&](std::size_t end) { return luminance(gathers[4 * k + end].irradiance); };
    study_.gradient[s][pixels_[k]] = Vec2d(e(0) - e(1), e(2) - e(3)) / pitch();
  }
}

void GroundRun::gradients() {
  study_.gather = gather_options(options_.cells, GradientMode::Full);
  std::vector<GatherPoint> points;
  for (const std::size_t i : pixels_) points.push_back(*pixel_point(i, 0, 0, kMaps));
  const double start = process_cpu_seconds();
  const auto gathers = gather(study_.gather, points, "gradients");
  const double ms = 1e3 * (process_cpu_seconds() - start) / double(pixels_.size());
  const auto take = [&](GradientSource source, GradientMode mode) {
    const auto s = static_cast<std::size_t>(source);
    const auto m = static_cast<std::size_t>(
        std::find(kGradientModes.begin(), kGradientModes.end(), mode) - kGradientModes.begin());
    study_.ms_per_pixel[s] = ms;
    study_.gradient[s].assign(study_.is_ground.size(), Vec2d(0.0));
    for (std::size_t k = 0; k < pixels_.size(); ++k) {
      const Vec3d g = luminance(gathers[k].gradient[m]);
      study_.gradient[s][pixels_[k]] = {g.x, g.z};
    }
  };
  take(GradientSource::Full, GradientMode::Full);
  take(GradientSource::Media, GradientMode::Media);
  take(GradientSource::WardHeckbert, GradientMode::WardHeckbert);

  differences(GradientSource::Differences, gather_options(options_.cells, GradientMode::None));
  GatherOptions fine = study_.gather;
  fine.gradient = GradientMode::None;
  fine.cells_theta = static_cast<int>(std::lround(fine.cells_theta * std::sqrt(kFineSamples)));
  fine.cells_phi = static_cast<int>(std::lround(fine.cells_phi * std::sqrt(kFineSamples)));
  differences(GradientSource::FineDifferences, fine);
}

// E on a lattice of half a pixel, a few times with random numbers that all points share:
// differences over a pixel are the truth, their spread over the seeds is its error, and differences
// over two pixels show what the step does.
void GroundRun::line_truth(const std::vector<double>& x, double z) {
  GradientLine& line = study_.line;
  const GatherOptions options = gather_options(options_.line_cells, GradientMode::None);
  const double half = pitch() / 2;
  std::vector<GatherPoint> points;
  for (int seed = 0; seed < options_.line_seeds; ++seed)
    for (const double middle : x)
      for (int step = -2; step <= 2; ++step) {
        if (step == 0) continue;
        GatherPoint p = *ground_.at(middle, z, 0);
        p.position.x = middle + step * half;
        p.key = key(kLine, static_cast<std::uint64_t>(seed));
        points.push_back(p);
      }
  const auto gathers = gather(options, points, "true gradient along the line");
  const auto e = [&](int seed, std::size_t i, std::size_t end) {
    return luminance(gathers[(static_cast<std::size_t>(seed) * x.size() + i) * 4 + end].irradiance);
  };
  const int seeds = options_.line_seeds;
  double squares = 0, error_squares = 0, step_squares = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    double mean = 0, mean2 = 0, wide = 0;
    for (int s = 0; s < seeds; ++s) {
      const double d = (e(s, i, 2) - e(s, i, 1)) / (2 * half);
      mean += d / seeds;
      mean2 += d * d / seeds;
      wide += (e(s, i, 3) - e(s, i, 0)) / (4 * half) / seeds;
    }
    const double variance = std::max(0.0, mean2 - mean * mean) / std::max(1, seeds - 1);
    line.truth.push_back(mean);
    line.truth_error.push_back(std::sqrt(variance));
    squares += mean * mean;
    error_squares += variance;
    step_squares += (wide - mean) * (wide - mean);
  }
  const double scale = squares > 0 ? 1 / squares : 0;
  line.truth_relative_error = std::sqrt(error_squares * scale);
  line.step_effect = std::sqrt(step_squares * scale);
}

void GroundRun::line() {
  const auto n = static_cast<std::size_t>(options_.pixels);
  const auto row = std::min(n - 1, static_cast<std::size_t>(options_.line_at * double(n)));
  const double z = ground_.z((double(row) + 0.5) / double(n));
  GradientLine& line = study_.line;
  std::vector<std::size_t> pixels;
  for (std::size_t i = 0; i < n; ++i)
    if (study_.is_ground[row * n + i]) {
      pixels.push_back(row * n + i);
      line.x.push_back(ground_.x((double(i) + 0.5) / double(n)));
    }
  line_truth(line.x, z);
  for (std::size_t s = 0; s < kSourceCount; ++s) {
    double squares = 0, truth = 0;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const double g = study_.gradient[s][pixels[i]].x;
      line.gradient[s].push_back(g);
      const double difference = g - line.truth[i];
      squares += difference * difference - line.truth_error[i] * line.truth_error[i];
      truth += line.truth[i] * line.truth[i];
    }
    line.relative_error[s] = truth > 0 ? std::sqrt(std::max(0.0, squares) / truth) : 0;
  }
}

// Returns the relative rms error; fills a pixel each where asked.
double GroundRun::extrapolate(const IrradianceCache& cache, std::vector<double>* irradiance) const {
  NoiseFreeError error;
  if (irradiance) irradiance->assign(study_.is_ground.size(), 0);
  for (const std::size_t i : pixels_) {
    const GatherPoint p = *pixel_point(i, 0, 0, kMaps);
    const InterpolatedIrradiance e = cache.irradiance({0, p.position, p.normal, 0});
    if (e.records == 0) continue;
    const double value = luminance(e.irradiance);
    if (irradiance) (*irradiance)[i] = value;
    error.add(value, reference_.first[i], reference_.second[i]);
  }
  return error.relative_rms();
}

void GroundRun::extrapolations() {
  const GroundRecords records =
      ground_records(ground_, options_.area, options_.records, key(kRecords, 0));
  for (const GatherPoint& p : records.points)
    study_.record_sites.push_back({(p.position.x - options_.area.min.x) / options_.area.size().x,
                                   (p.position.z - options_.area.min.z) / options_.area.size().z});
  const auto caches = make_ground_caches(
      records,
      gather(gather_options(options_.record_cells, GradientMode::Full), records.points, "records"));
  for (std::size_t m = 0; m < kModeCount; ++m)
    study_.extrapolation[m].relative_rms =
        extrapolate(caches[m], &study_.extrapolation[m].irradiance);
}

ConvergencePoint GroundRun::convergence(int along, int cells) const {
  ConvergencePoint point;
  const GatherOptions options = gather_options(cells, GradientMode::Full);
  for (int repeat = 0; repeat < options_.repeats; ++repeat) {
    const GroundRecords records = ground_records(
        ground_, options_.area, along,
        key(kRecords, static_cast<std::uint64_t>(repeat) + 1, static_cast<std::uint64_t>(along)));
    const auto caches = make_ground_caches(records, gather(options, records.points, "convergence"));
    for (std::size_t m = 0; m < kModeCount; ++m) {
      const double rms = extrapolate(caches[m], nullptr);
      point.relative_rms[m] += rms * rms / options_.repeats;
    }
  }
  for (double& rms : point.relative_rms) rms = std::sqrt(rms);
  return point;
}

void GroundRun::convergences() {
  for (const int cells : options_.cell_counts) {
    ConvergencePoint point = convergence(options_.records, cells);
    const GatherOptions used = gather_options(cells, GradientMode::Full);
    point.along = cells;
    point.count = double(used.cells_theta) * used.cells_phi;
    study_.by_cells.push_back(point);
  }
  for (const int along : options_.record_counts) {
    ConvergencePoint point = convergence(along, options_.record_cells);
    point.along = along;
    point.count = double(along) * along;
    study_.by_records.push_back(point);
  }
}

GroundStudy GroundRun::run() {
  study_.pixels = options_.pixels;
  find_ground();
  reference();
  gradients();
  line();
  extrapolations();
  convergences();
  return std::move(study_);
}

}  // namespace

GroundStudy study_ground(const StudyScene& scene, const GroundOptions& options,
                         const StudyRun& run) {
  return GroundRun(scene, options, run).run();
}

}  // namespace brume
