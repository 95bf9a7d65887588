// The reference: an unbiased path tracer with delta tracking for distances and ratio tracking for
// transmittance. It shares no marching code with the cached integrator, so that the two check each other
// (DESIGN 3).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "plan/effects.h"
#include "render/film.h"
#include "scene/camera_rays.h"
#include "scene/world.h"

namespace brume {

// Full: every path the scene holds.
// Cached: exactly the paths that the cached integrator includes (SPEC, bounces and volume_bounces).
// Followed from the eye: at most `bounces` reflections by surfaces after the first vertex, and at most
// `volume_bounces` scatterings in the medium before the first surface and between one surface and the
// next. Each scattering takes up light straight from lights; each but the last of a run also what the
// medium emits and scatters, what surfaces reflect, and "direct": false emitters. So 0: no scattering;
// 1: only light straight from lights scatters. With `bounces` 0 surfaces show light straight from lights
// alone, and light in the medium has met none.
enum class Transport { Full, Cached };

struct PathTracerOptions {
  Transport transport = Transport::Full;
  int bounces = 4;                    // Cached only; Full runs until Russian roulette ends a path.
  int volume_bounces = kEveryOrder;   // Cached only.
  std::uint64_t seed = 1;
  int threads = 0;
  int samples = 64;                   // --spp
  // --noise E: samples are added in doubling passes until the estimated relative error of the image,
  // sqrt(sum of pixel variances of the mean) / sum of luminances over 8x8 blocks, is at most E.
  std::optional<double> noise;
  int max_samples = 1 << 20;
  Interval crop_x{0, 1}, crop_y{0, 1};  // Parts of the image; pixels outside stay 0.
  std::function<void(double fraction)> progress;  // Called from any thread, rising.
  std::function<bool()> stop_requested;
};

struct PathTracerResult {
  int samples = 0;              // Per pixel.
  double estimated_error = 0;   // As for `noise`.
  std::uint64_t rays = 0, lookups = 0;  // Rays traced, density lookups.
};

// Fills `film` with every layer: the first vertex seen by the eye decides the layer (diffuse or glossy by
// the lobe, direct or indirect by what lit it; volume_direct: lit straight from lights at the vertex).
PathTracerResult trace_paths(const World& world, const CameraRays& camera,
                             const PathTracerOptions& options, PixelFilm& film);

}  // namespace brume
