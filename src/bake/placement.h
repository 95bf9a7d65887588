// Where records may go: points of surfaces, in an order that depends on the scene and the view
// alone.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "bake/bake.h"

namespace brume {

// A point of a surface on the side that receives.
struct SurfacePoint {
  Vec3d position{0.0}, normal{0.0};
  double offset = 0;      // Clears the surface.
  double min_radius = 0;  // Records act as at least this wide here.
  double weight = 0;      // Of what asks for light here, against other points.
};

// All surfaces, both sides, in patches that are halved only while records leave them open: what a
// wave costs follows from what is still open, not from how far surfaces go.
class SurfacePatches {
 public:
  explicit SurfacePatches(const RayTracer& tracer);

  // The size of the largest patch, 0 without any.
  double largest() const;
  // Halves patches until none is larger than `spacing`. Those that `is_covered` at their corners
  // and middle are done, and never come back; any thread.
  void split(double spacing, int threads,
             const std::function<bool(const SurfacePoint&)>& is_covered);
  // About one point for each open cell of `spacing` squared, stratified over open patches; a pure
  // function of them and the seed.
  std::vector<SurfacePoint> points(double spacing, std::uint64_t seed) const;

 private:
  struct Patch {
    std::uint32_t mesh, triangle;
    std::array<Vec2d, 3> corners;  // In the triangle's barycentrics.
    bool front;
  };
  SurfacePoint point(const Patch& patch, const Vec2d& at) const;
  double size2(const Patch& patch, int* longest = nullptr) const;
  double area(const Patch& patch) const;

  const RayTracer& tracer_;
  std::vector<Patch> open_;
};

// Two thousand points for gathers to begin with, both sides, half of them by area and half by
// triangle, so that neither vast ground nor fine meshes keep all of them.
std::vector<SurfacePoint> some_surface_points(const RayTracer& tracer, std::uint64_t seed);

// Candidates count as covered a little inside a record's edge, where its weight is not yet 0.
inline constexpr double kCoveredWithin = 0.8;

// Those of `points`, in order, that keep `distance` from every one kept before on the same side.
std::vector<SurfacePoint> thin(const std::vector<SurfacePoint>& points, double distance);
// The same with a distance of its own for each: `part` of its min_radius. Looks at the widest
// first, and keeps at most so many.
std::vector<SurfacePoint> thin_by_footprint(std::vector<SurfacePoint> points, double part,
                                            std::size_t most);

// What the points (x0 + i stride, y0 + j stride) inside a rectangle see, without those that also
// lie on the lattice of twice the stride when `skip_coarser`. There are kPointsPerPixel along each
// edge of a pixel.
struct PixelRect {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};
std::vector<SurfacePoint> view_points(const World& world, const BakeView& view,
                                      const PixelRect& rect, int stride, bool skip_coarser);

}  // namespace brume
