#include "render/path_tracer.h"

#include <atomic>
#include <memory>
#include <mutex>

#include "core/parallel.h"
#include "render/reference_paths.h"

namespace brume {
namespace {

constexpr int kTile = 16;       // Pixels along a tile's edge: one task.
constexpr int kNoiseBlock = 8;  // Pixels along the edge of a block whose noise is judged.
constexpr int kFirstPass = 16;  // Samples before noise is judged for the first time.

struct PixelRange {
  int begin = 0, end = 0;
  int count() const { return std::max(0, end - begin); }
};

PixelRange cropped(const Interval& part, int size) {
  const auto pixel = [&](double x) {
    return static_cast<int>(std::lround(std::clamp(x, 0.0, 1.0) * size));
  };
  return {pixel(part.begin), pixel(part.end)};
}

// What one pixel's samples have added up to.
struct Sums {
  PixelResult sum;  // z: the nearest.
  int samples = 0, hits = 0;
  double luminance = 0, luminance2 = 0;

  void add(const PixelResult& s) {
    const bool is_first = samples++ == 0;
    for (int l = 0; l < kLayerCount; ++l) sum.layers[l] += s.layers[l];
    sum.alpha += s.alpha;
    sum.z = is_first ? s.z : std::min(sum.z, s.z);
    hits += s.z < kInfinity;
    sum.normal += s.normal;
    sum.position += s.position;
    sum.albedo += s.albedo;
    sum.transmittance = is_first ? s.transmittance : sum.transmittance + s.transmittance;
    sum.cost += s.cost;
    const double y = brume::luminance(s.beauty());
    luminance += y;
    luminance2 += y * y;
  }
  PixelResult mean() const {
    PixelResult r = sum;
    if (samples == 0) return {};
    const double k = 1.0 / samples;
    for (RgbD& layer : r.layers) layer *= k;
    r.alpha *= k;
    const double length = r.normal.length();
    r.normal = length > 0 ? r.normal / length : Vec3d(0.0);
    r.position = hits ? r.position / hits : Vec3d(0.0);
    r.albedo *= k;
    r.transmittance *= k;
    r.cost *= k;
    return r;
  }
  double mean_luminance() const { return samples ? luminance / samples : 0; }
  // Of the mean; infinite where one sample says nothing about it.
  double variance() const {
    if (samples < 2) return samples ? kInfinity : 0;
    const double m = luminance / samples;
    return std::max(0.0, luminance2 / samples - m * m) / (samples - 1);
  }
};

// Root mean square over blocks of the block's standard error, relative to the blocks' mean.
double relative_error(const std::vector<Sums>& pixels, int width, int height) {
  double variance = 0, luminance = 0;
  int blocks = 0;
  for (int by = 0; by < height; by += kNoiseBlock)
    for (int bx = 0; bx < width; bx += kNoiseBlock) {
      ++blocks;
      for (int y = by; y < std::min(by + kNoiseBlock, height); ++y)
        for (int x = bx; x < std::min(bx + kNoiseBlock, width); ++x) {
          const Sums& p = pixels[std::size_t(y) * width + x];
          variance += p.variance();
          luminance += p.mean_luminance();
        }
    }
  if (!(variance > 0)) return 0;
  return luminance > 0 ? std::sqrt(variance * blocks) / luminance : kInfinity;
}

}  // namespace

PathTracerResult trace_paths(const World& world, const CameraRays& camera,
                             const PathTracerOptions& options, PixelFilm& film) {
  const PixelRange columns = cropped(options.crop_x, film.width());
  const PixelRange rows = cropped(options.crop_y, film.height());
  const int width = columns.count(), height = rows.count();
  std::vector<Sums> pixels(std::size_t(width) * height);
  const int tiles_x = (width + kTile - 1) / kTile, tiles_y = (height + kTile - 1) / kTile;
  const std::size_t tiles = std::size_t(tiles_x) * tiles_y;

  const int slots = resolve_thread_count(options.threads);
  std::vector<std::unique_ptr<ReferencePaths>> paths;
  for (int i = 0; i < slots; ++i)
    paths.push_back(std::make_unique<ReferencePaths>(world, options));

  const int most = options.noise ? options.max_samples : options.samples;
  std::atomic<bool> is_stopped = false;
  std::mutex progress_mutex;
  std::size_t tiles_done = 0;
  PathTracerResult result;
  int done = 0;
  while (done < most && !is_stopped) {
    const int target = options.noise ? std::min(most, done ? 2 * done : kFirstPass) : most;
    tiles_done = 0;
    parallel_for_slots(options.threads, tiles, 1, [&](std::size_t tile, int slot) {
      if (is_stopped || (options.stop_requested && options.stop_requested())) {
        is_stopped = true;
        return;
      }
      const int x0 = int(tile % tiles_x) * kTile, y0 = int(tile / tiles_x) * kTile;
      for (int y = y0; y < std::min(y0 + kTile, height); ++y)
        for (int x = x0; x < std::min(x0 + kTile, width); ++x) {
          // By the pixel's place in the whole image, so that a crop shows the same picture.
          const int px = columns.begin + x, py = rows.begin + y;
          const std::uint64_t key = random_key(options.seed, std::uint64_t(py) * film.width() + px);
          Sums& sums = pixels[std::size_t(y) * width + x];
          for (int s = done; s < target; ++s) {
            const SamplePoints points(key, std::uint32_t(s));
            RandomStream random(random_key(key, s));
            const Vec2d jitter = points.square(0);
            const Ray ray = camera.ray(px + jitter.x, py + jitter.y);
            PixelResult sample = paths[slot]->trace(ray, points, random);
            if (sample.z < kInfinity) sample.z *= ray.direction.dot(camera.forward());
            sums.add(sample);
          }
        }
      if (!options.progress) return;
      const std::lock_guard lock(progress_mutex);
      const double pass = double(++tiles_done) / tiles;
      options.progress((done + pass * (target - done)) / most);
    });
    if (!is_stopped) done = target;
    result.estimated_error = relative_error(pixels, width, height);
    if (options.noise && result.estimated_error <= *options.noise) break;
  }
  if (options.progress && !is_stopped) options.progress(1);

  result.samples = done;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      film.at(columns.begin + x, rows.begin + y) = pixels[std::size_t(y) * width + x].mean();
  for (const auto& p : paths) {
    result.rays += p->rays();
    result.lookups += p->lookups();
  }
  return result;
}

}  // namespace brume
