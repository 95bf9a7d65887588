// Points of all surfaces by area.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "geom/ray_tracer.h"

namespace brume {

// Immutable, shared by threads. The tracer must outlive it.
class SurfaceArea {
 public:
  explicit SurfaceArea(const RayTracer& tracer);

  double area() const { return up_to_.empty() ? 0 : up_to_.back(); }
  std::size_t triangle_count() const { return triangles_.size(); }
  // The point at that part of the area in [0, 1), triangle by triangle, and within its triangle at
  // u in [0, 1)^2. Not where area() is 0.
  Hit point(double part, const Vec2d& u) const;
  // Of the triangle at that part of all, each counted once. Not without any.
  Hit point_by_triangle(double part, const Vec2d& u) const;

 private:
  Hit point_of(std::size_t triangle, const Vec2d& u) const;

  const RayTracer& tracer_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> triangles_;  // Mesh and triangle.
  std::vector<double> up_to_;                                       // Running sums of their areas.
};

}  // namespace brume
