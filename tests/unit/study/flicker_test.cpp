// Flicker of frames whose light is known: a floor seen by a camera that moves along it.
#include "study/flicker.h"

#include <gtest/gtest.h>

#include <functional>

#include "core/error.h"
#include "core/random.h"
#include "scene/camera_rays.h"

namespace brume {
namespace {

constexpr int kWidth = 64, kHeight = 48;
using Light = std::function<double(const Vec3d& position, int x, int y)>;

// The plane y = 0 from a camera above it at `x`.
FlickerFrame floor_frame(double x, const Light& light) {
  Camera camera;
  camera.position = Vec3d(x, 2, 3);
  camera.look_at = Vec3d(x, 0, 0);
  const CameraRays rays(camera, kWidth, kHeight);
  FlickerFrame frame;
  frame.width = kWidth;
  frame.height = kHeight;
  frame.world_to_camera = rays.world_to_camera();
  frame.fov_deg = rays.fov_deg();
  for (int j = 0; j < kHeight; ++j)
    for (int i = 0; i < kWidth; ++i) {
      const Ray ray = rays.ray(i + 0.5, j + 0.5);
      const double t = -ray.origin.y / ray.direction.y;
      const Vec3d p = ray.at(t);
      frame.position.emplace_back(float(p.x), float(p.y), float(p.z));
      frame.normal.emplace_back(0.0f, 1.0f, 0.0f);
      frame.depth.push_back(static_cast<float>(t * ray.direction.dot(rays.forward())));
      frame.alpha.push_back(1);
      frame.light.push_back(Rgb(static_cast<float>(light(p, i, j))));
    }
  return frame;
}

double pattern(const Vec3d& p, int, int) { return 2 + std::sin(p.x) + 0.3 * p.z; }

Light noisy(const Light& light, double deviation, std::uint64_t seed) {
  return [=](const Vec3d& p, int x, int y) {
    RandomStream random(random_key(seed, x, y));
    const double z =
        std::sqrt(-2 * std::log(1 - random.uniform())) * std::cos(2 * kPi * random.uniform());
    return light(p, x, y) + deviation * z;
  };
}

TEST(Flicker, IsNoneWhereLightStaysOnItsSurface) {
  const Flicker f =
      frame_flicker({floor_frame(0, pattern), {}}, {floor_frame(0.2, pattern), {}}, {});
  EXPECT_GT(f.matched, 0.85);
  EXPECT_LT(f.matched, 1) << "what left the image is in no other frame";
  EXPECT_LT(f.change, 1e-3);
}

TEST(Flicker, IsTheChangeThatTheReferenceDoesNotShow) {
  const Light brighter = [](const Vec3d& p, int x, int y) { return 1.1 * pattern(p, x, y); };
  const Light both = [&](const Vec3d& p, int x, int y) { return brighter(p, x, y) + 0.08; };
  const Flicker f = frame_flicker({floor_frame(0, pattern), {floor_frame(0, pattern)}},
                                  {floor_frame(0.1, both), {floor_frame(0.1, brighter)}}, {});
  EXPECT_NEAR(f.reference_change, 0.1, 0.03);
  EXPECT_NEAR(f.error_change, 0.08 / 2, 0.01) << "0.08 over a mean of about 2";
  EXPECT_GT(f.change, f.reference_change);
}

TEST(Flicker, ASteadyErrorIsNoFlicker) {
  const Light wrong = [](const Vec3d& p, int x, int y) {
    return pattern(p, x, y) + std::cos(2 * p.x);
  };
  const Flicker f = frame_flicker({floor_frame(0, wrong), {floor_frame(0, pattern)}},
                                  {floor_frame(0.1, wrong), {floor_frame(0.1, pattern)}}, {});
  EXPECT_LT(f.error_change, 3e-3);
}

TEST(Flicker, NoiseOfTwoReferencesDoesNotCount) {
  double one = 0, two = 0;
  constexpr int kTimes = 20;
  for (std::uint64_t i = 0; i < kTimes; ++i) {
    const FlickerView a{floor_frame(0, pattern),
                        {floor_frame(0, noisy(pattern, 0.5, 4 * i)),
                         floor_frame(0, noisy(pattern, 0.5, 4 * i + 1))}};
    const FlickerView b{floor_frame(0.1, pattern),
                        {floor_frame(0.1, noisy(pattern, 0.5, 4 * i + 2)),
                         floor_frame(0.1, noisy(pattern, 0.5, 4 * i + 3))}};
    const double with_two = frame_flicker(a, b, {}).error_change;
    two += with_two * std::abs(with_two) / kTimes;
    const double with_one =
        frame_flicker({a.frame, {a.references[0]}}, {b.frame, {b.references[0]}}, {}).error_change;
    one += with_one * std::abs(with_one) / kTimes;
  }
  // A block's mean of 64 pixels: 0.5 / 8 in both frames, the second smoothed by its bilinear
  // look-up.
  EXPECT_GT(std::sqrt(one), 0.03);
  EXPECT_LT(std::abs(two), 0.1 * one);
}

TEST(Flicker, HiddenSurfacesAreNotCompared) {
  FlickerFrame a = floor_frame(0, pattern), b = floor_frame(0, pattern);
  // Something stands before the right half of b.
  for (int j = 0; j < kHeight; ++j)
    for (int i = kWidth / 2; i < kWidth; ++i) {
      const auto k = static_cast<std::size_t>(j * kWidth + i);
      b.position[k].y += 1;
      b.light[k] = Rgb(100);
    }
  const Flicker f = frame_flicker({a, {}}, {b, {}}, {});
  EXPECT_NEAR(f.matched, 0.5, 0.05);
  EXPECT_LT(f.change, 1e-3);
}

TEST(Flicker, RefusesFramesOfTwoSizes) {
  FlickerFrame small = floor_frame(0, pattern);
  small.width = kWidth / 2;
  EXPECT_THROW(frame_flicker({floor_frame(0, pattern), {}}, {small, {}}, {}), Error);
}

}  // namespace
}  // namespace brume
