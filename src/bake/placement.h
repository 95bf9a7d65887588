// Where records may go: points of surfaces, in an order that depends on the scene and the view alone.
#pragma once

#include <cstdint>
#include <vector>

#include "bake/bake.h"

namespace brume {

// A point of a surface on the side that receives.
struct SurfacePoint {
  Vec3d position{0.0}, normal{0.0};
  double offset = 0;      // Clears the surface.
  double min_radius = 0;  // Records act as at least this wide here.
};

// All surfaces, both sides, by area.
class SurfacePoints {
 public:
  explicit SurfacePoints(const RayTracer& tracer);
  double area() const { return cumulative_.empty() ? 0 : cumulative_.back(); }
  // One point a cell of `spacing` squared, more or less, stratified over the area; a pure function of the
  // geometry, spacing and seed.
  std::vector<SurfacePoint> points(double spacing, std::uint64_t seed) const;

 private:
  const RayTracer& tracer_;
  std::vector<double> cumulative_;  // Of triangle areas.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> triangle_;
};

// Waves over all surfaces, each twice as dense as the one before, from `coarsest` until nothing is left
// open at `finest`.
int placement_waves(double coarsest, double finest);

// Candidates count as covered a little inside a record's edge, where its weight is not yet 0.
inline constexpr double kCoveredWithin = 0.8;

// Those of `points`, in order, that keep `distance` from every one kept before on the same side.
std::vector<SurfacePoint> thin(const std::vector<SurfacePoint>& points, double distance);

// What the pixel centres (x0 + i stride, y0 + j stride) inside a rectangle see, without those that also
// lie on the lattice of twice the stride when `skip_coarser`.
struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};
std::vector<SurfacePoint> view_points(const World& world, const BakeView& view, const PixelRect& rect,
                                      int stride, bool skip_coarser);

}  // namespace brume
