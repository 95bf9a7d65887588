// The cached integrator: direct light and single scattering for each pixel, irradiance from records.
#pragma once

#include <cstdint>
#include <functional>

#include "bake/bake.h"
#include "cache/irradiance_cache.h"
#include "scene/camera_rays.h"
#include "render/film.h"

namespace brume {

struct CachedRenderOptions {
  int samples = 16;        // A pixel, well spread; antialiasing, area lights and the medium share them.
  int eye_shells = 16;     // Steps of single scattering along an eye ray, each at another place every sample.
  double step_voxels = 0;  // 0: exact.
  int threads = 0;
  Interval crop_x{0, 1}, crop_y{0, 1};  // Parts of the image; pixels outside stay 0.
  // Where no record answers: gather there and then (counted), else the nearest records stretched.
  bool gather_fallback = true;
  // Ignore records and gather at every sample's hit: slow, without interpolation error.
  bool gather_everywhere = false;
  Scattered scattered;  // As light_below() takes it.
  std::function<void(double fraction)> progress;
  std::function<bool()> stop_requested;
};

struct CachedRenderResult {
  Counters counters;
  bool is_stopped = false;
};

CachedRenderResult render_cached(const Lighting& lighting, const BakeSettings& settings,
                                 const IrradianceCache& cache, const CameraRays& camera,
                                 const CachedRenderOptions& options, PixelFilm& film);

}  // namespace brume
