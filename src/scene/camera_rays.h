// From pixels to rays: a pinhole camera with a box filter.
#pragma once

#include "core/math.h"
#include "scene/scene.h"

namespace brume {

class CameraRays {
 public:
  // Throws Error(InvalidInput) where position and look_at coincide or up is parallel to the view.
  CameraRays(const Camera& camera, int width, int height);

  // (0,0) is the top left corner of the image, pixel (i,j) spans [i,i+1) x [j,j+1).
  Ray ray(double x, double y) const;
  // Width of a pixel at distance 1 on the axis; times the distance it is a footprint.
  double pixel_angle() const { return pixel_angle_; }
  double fov_deg() const;  // Vertical.
  const Vec3d& forward() const { return forward_; }
  // Row-major world-to-camera matrix for image metadata.
  std::array<float, 16> world_to_camera() const;

 private:
  Vec3d position_{0.0}, forward_{0.0}, right_{0.0}, up_{0.0};
  double half_width_ = 1, half_height_ = 1, pixel_angle_ = 0;
  int width_ = 1, height_ = 1;
};

}  // namespace brume
