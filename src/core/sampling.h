// Maps from the unit square to directions and positions. Directions are local: z is the normal.
#pragma once

#include "core/math.h"

namespace brume {

// pdf = cos / pi.
inline Vec3d sample_cosine_hemisphere(const Vec2d& u) {
  const double s = std::sqrt(u.x), phi = 2 * kPi * u.y;
  return {s * std::cos(phi), s * std::sin(phi), std::sqrt(std::max(0.0, 1 - u.x))};
}

// pdf = 1 / (4 pi).
inline Vec3d sample_sphere(const Vec2d& u) {
  const double z = 1 - 2 * u.x, s = std::sqrt(std::max(0.0, 1 - z * z)), phi = 2 * kPi * u.y;
  return {s * std::cos(phi), s * std::sin(phi), z};
}

// Barycentrics (b1, b2), uniform over the triangle.
inline Vec2d sample_triangle(const Vec2d& u) {
  const double s = std::sqrt(u.x);
  return {1 - s, u.y * s};
}

}  // namespace brume
