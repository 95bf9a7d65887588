// The reference: an unbiased path tracer with delta tracking for distances and ratio tracking for
// transmittance. It shares no marching code with the cached integrator, so that the two check each other
// (DESIGN 3).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "scene/camera_rays.h"
#include "render/film.h"
#include "scene/world.h"

namespace brume {

// Full: every path the scene holds (bounces and volume_bounces as limits where given).
// Cached: exactly the paths that the cached integrator includes (SPEC, bounces and volume_bounces): after
// the eye, at most `bounces` surface reflections before the last vertex; a scattering in the medium ends
// the path with light straight from lights (volume_bounces 1) or does not happen (0).
enum class Transport { Full, Cached };

struct PathTracerOptions {
  Transport transport = Transport::Full;
  int bounces = 4;                    // Cached only; Full runs until Russian roulette ends a path.
  int volume_bounces = 1;             // Cached only: 0 or 1.
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
