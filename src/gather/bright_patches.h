// Small places that are much brighter than the rest of a scene: a wall behind a lamp, a ceiling
// above one, what a narrow spot lights. Seen from afar they fall between a gather's rays, or count
// far too much where one happens to hit (docs/decisions/0013).
#pragma once

#include <span>
#include <vector>

#include "core/random.h"
#include "plan/effects.h"
#include "scene/world.h"

namespace brume {

// A rectangle that holds what is bright, lit on the side of its normal.
struct BrightPatch {
  Vec3d centre{0.0}, normal{0.0}, u{0.0}, v{0.0};  // u, v: half edges.
  int seen = 0;  // Of the places that were tried; a part of them for a patch within another.
  double area() const { return 4 * u.cross(v).length(); }
};

// Found where rays of lamps land densely; a pure function of the world, whose medium does not
// count. Immutable, shared by threads. The world must outlive it.
class BrightPatches {
 public:
  explicit BrightPatches(const World& world);

  bool empty() const { return places_.empty(); }
  // Patches that `origin` sees, on the side of `normal` (0: all around), the most seen first: tried
  // are a few places, each under less than `solid_angle`, drawn by what they would bring
  // unoccluded; what is seen and lies close together is one patch. Where little of the largest ones
  // is seen, as past an edge, the rectangles that hold it are patches besides, found by `pilots`
  // points. Costs up to 256 shadow rays and 15 for each pilot, at most.
  void visible_from(const Vec3d& origin, const Vec3d& normal, double solid_angle,
                    std::size_t pilots, RandomStream random, Counters& counters,
                    std::vector<BrightPatch>& visible) const;

 private:
  struct Place {
    Vec3d position{0.0}, normal{0.0};
    double radius = 0;  // Of a disk that so many lamps' rays hit.
  };
  static std::vector<Place> landings(const World& world);
  static void find_radii(std::vector<Place>& places);
  static BrightPatch patch_of(std::span<const Place* const> places);
  static void split(std::span<const Place*> places, int depth, std::vector<BrightPatch>& patches);
  void refine(const BrightPatch& coarse, std::size_t pilots, const Vec3d& origin,
              RandomStream& random, Counters& counters, std::vector<BrightPatch>& patches) const;
  void bright_points(const BrightPatch& patch, double wider, std::size_t pilots,
                     const Vec3d& origin, RandomStream& random, Counters& counters,
                     std::vector<Place>& points) const;

  const World& world_;
  std::vector<Place> places_;
};

}  // namespace brume
