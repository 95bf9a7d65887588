// What the path tracer answers along one ray, with its standard error.
#pragma once

#include <gtest/gtest.h>

#include <functional>

#include "render/path_tracer.h"

namespace brume::test {

// The mean over an image, and the standard error of the mean from the spread of its pixels.
struct Measured {
  RgbD mean, error;
};

// A sensor of independent pixels that all look along one ray.
class Sensor {
 public:
  Sensor(const Vec3d& position, const Vec3d& look_at, int pixels = 16)
      : size_(pixels), film_(pixels, pixels) {
    camera_.position = position;
    camera_.look_at = look_at;
    const Vec3d d = look_at - position;
    camera_.up = std::abs(d.y) > 0.9 * d.length() ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0);
    camera_.fov_deg = 1e-6;
  }
  // Pixels that look where the camera's do, for scenes that look alike in all of them.
  explicit Sensor(const Camera& camera, int pixels = 16)
      : size_(pixels), camera_(camera), film_(pixels, pixels) {}
  PathTracerResult expose(const World& world, const PathTracerOptions& options) {
    return trace_paths(world, CameraRays(camera_, size_, size_), options, film_);
  }
  Measured of(const std::function<RgbD(const PixelResult&)>& value) const {
    Measured m;
    const double n = double(size_) * size_;
    RgbD squares;
    for (int y = 0; y < size_; ++y)
      for (int x = 0; x < size_; ++x) {
        const RgbD v = value(film_.at(x, y));
        m.mean += v / n;
        squares += v * v / n;
      }
    for (int c = 0; c < 3; ++c)
      m.error[c] = std::sqrt(std::max(0.0, squares[c] - m.mean[c] * m.mean[c]) / (n - 1));
    return m;
  }
  Measured layer(Layer layer) const {
    return of([=](const PixelResult& p) { return p[layer]; });
  }
  Measured beauty() const {
    return of([](const PixelResult& p) { return p.beauty(); });
  }
  const PixelFilm& film() const { return film_; }

 private:
  int size_;
  Camera camera_;
  PixelFilm film_;
};

// Within four standard errors, or the given relative tolerance where that is more; the error itself
// must be small enough to mean something.
inline void expect_near(const Measured& m, const RgbD& expected, double relative = 1e-6,
                 double most_error = 0.02) {
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(m.mean[c], expected[c],
                std::max(4 * m.error[c], relative * std::abs(expected[c])) + 1e-12)
        << "channel " << c << ", standard error " << m.error[c];
    EXPECT_LE(m.error[c], most_error * std::abs(expected[c]) + 1e-9) << "channel " << c;
  }
}

inline PathTracerOptions options_of(Transport transport, int samples, int bounces = 1) {
  PathTracerOptions options;
  options.transport = transport;
  options.samples = samples;
  options.bounces = bounces;
  options.threads = 2;
  return options;
}

}  // namespace brume::test
