#include "scene/camera_rays.h"

#include <gtest/gtest.h>

#include "core/error.h"

namespace brume {
namespace {

Camera along_minus_z() {
  Camera camera;
  camera.position = {1, 2, 3};
  camera.look_at = {1, 2, -7};
  camera.fov_deg = 90;
  return camera;
}

TEST(CameraRays, CentreLooksAtTheTarget) {
  const CameraRays rays(along_minus_z(), 640, 480);
  const Ray ray = rays.ray(320, 240);
  EXPECT_NEAR((ray.direction - Vec3d(0, 0, -1)).length(), 0, 1e-15);
  EXPECT_EQ(ray.origin, Vec3d(1, 2, 3));
}

TEST(CameraRays, TopLeftIsUpAndLeft) {
  const CameraRays rays(along_minus_z(), 200, 100);
  // tan(45 deg) up, twice that to the left.
  const Vec3d d = rays.ray(0, 0).direction;
  EXPECT_NEAR(d.x / -d.z, -2, 1e-12);
  EXPECT_NEAR(d.y / -d.z, 1, 1e-12);
}

TEST(CameraRays, FieldOfViewIsVertical) {
  const CameraRays rays(along_minus_z(), 30, 100);
  const Vec3d top = rays.ray(15, 0).direction, bottom = rays.ray(15, 100).direction;
  EXPECT_NEAR(std::acos(top.dot(bottom)) * 180 / kPi, 90, 1e-9);
}

TEST(CameraRays, PixelAngleIsAPixelsWidthAtDistanceOne) {
  const CameraRays rays(along_minus_z(), 300, 200);
  const Vec3d a = rays.ray(150, 100).direction, b = rays.ray(151, 100).direction;
  EXPECT_NEAR((b / -b.z - a / -a.z).length(), rays.pixel_angle(), 1e-12);
}

TEST(CameraRays, WorldToCameraPutsTheViewOnMinusZ) {
  Camera camera;
  camera.position = {3, -1, 2};
  camera.look_at = {0, 0.5, 1};
  camera.up = {0, 0, 1};
  const auto m = CameraRays(camera, 4, 4).world_to_camera();
  const auto apply = [&](const Vec3d& p) {
    Vec3d q;
    for (int i = 0; i < 3; ++i)
      q[i] = m[4 * i] * p.x + m[4 * i + 1] * p.y + m[4 * i + 2] * p.z + m[4 * i + 3];
    return q;
  };
  EXPECT_NEAR(apply(camera.position).length(), 0, 1e-6);
  const Vec3d target = apply(camera.look_at);
  EXPECT_NEAR(target.x, 0, 1e-6);
  EXPECT_NEAR(target.y, 0, 1e-6);
  EXPECT_NEAR(target.z, -(camera.look_at - camera.position).length(), 1e-6);
  EXPECT_GT(apply(camera.position + Vec3d(0, 0, 1)).y, 0);
}

TEST(CameraRays, RefusesImpossibleCameras) {
  Camera camera = along_minus_z();
  camera.look_at = camera.position;
  EXPECT_THROW(CameraRays(camera, 4, 4), Error);
  camera = along_minus_z();
  camera.up = {0, 0, 5};
  EXPECT_THROW(CameraRays(camera, 4, 4), Error);
}

}  // namespace
}  // namespace brume
