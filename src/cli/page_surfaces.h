// A scene's triangles for the page of records, turned to the side that records lie on.
#pragma once

#include <span>
#include <vector>

#include "cache/record.h"
#include "scene/world.h"

namespace brume {

// Nine floats a triangle, relative to `centre`.
struct PageSurfaces {
  // Counter-clockwise from where their records are, so that a room can be looked into from outside.
  std::vector<float> turned;
  std::vector<float> two_sided;  // Records on both sides, or on none of the whole mesh.
};

PageSurfaces page_surfaces(const World& world, std::span<const SurfaceRecord> records,
                           const Vec3d& origin, const Vec3d& centre);

}  // namespace brume
