#include "scene/camera_rays.h"

#include "core/error.h"

namespace brume {

CameraRays::CameraRays(const Camera& camera, int width, int height)
    : position_(camera.position), width_(width), height_(height) {
  const Vec3d view = camera.look_at - camera.position;
  const double distance = view.length();
  if (!(distance > 0) || !std::isfinite(distance))
    throw Error(ErrorKind::InvalidInput,
                "camera: position and look_at are the same point: move one of them");
  forward_ = view / distance;
  const Vec3d right = forward_.cross(camera.up);
  if (!(right.length() > 1e-9 * camera.up.length()))
    throw Error(ErrorKind::InvalidInput,
                "camera: up is parallel to the view: choose another up direction");
  right_ = right.normalized();
  up_ = right_.cross(forward_);
  half_height_ = std::tan(camera.fov_deg * kPi / 360);
  half_width_ = half_height_ * width / height;
  pixel_angle_ = 2 * half_height_ / height;
}

Ray CameraRays::ray(double x, double y) const {
  const double sx = (2 * x / width_ - 1) * half_width_, sy = (1 - 2 * y / height_) * half_height_;
  return {position_, (forward_ + right_ * sx + up_ * sy).normalized()};
}

double CameraRays::fov_deg() const { return std::atan(half_height_) * 360 / kPi; }

// The camera looks along -z with y up, as EXR viewers expect.
std::array<float, 16> CameraRays::world_to_camera() const {
  const Vec3d rows[3] = {right_, up_, -forward_};
  std::array<float, 16> m{};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) m[4 * i + j] = static_cast<float>(rows[i][j]);
    m[4 * i + 3] = static_cast<float>(-rows[i].dot(position_));
  }
  m[15] = 1;
  return m;
}

}  // namespace brume
