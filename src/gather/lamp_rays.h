// More rays where a gather looks past a lamp in a medium: at an angle h from the lamp's direction
// the light that the medium scatters goes as 1/h, whose square no cell can integrate, so a ray that
// happens to pass close by would make a record far too bright (docs/decisions/0011).
#pragma once

#include <span>
#include <vector>

#include "core/random.h"
#include "gather/direction_cells.h"
#include "plan/effects.h"
#include "scene/world.h"

namespace brume {

// A ray besides those of the cells. What the medium sends along it counts `share`, in the mean of
// its cell.
struct LampRay {
  Vec3d direction{0.0};  // World space.
  int cell = 0;
  double share = 0;
  int lamp = 0, stratum = 0;
};

// Of point and spot lamps: evenly in h, as dense as 1/h, out to a few cells from a lamp, or along
// all of a beam that is seen from its side. Rays of cells and of lamps share a cell by the balance
// heuristic, so that nothing is lost or counted twice. Scratch memory of one thread.
class LampRays {
 public:
  // None where the medium scatters nothing.
  LampRays(const World& world, const Effects& effects);

  // `frame` turns local directions into the world.
  void draw(const Vec3d& origin, const Frame& frame, const DirectionCells& cells,
            RandomStream random);

  std::span<const LampRay> rays() const { return rays_; }
  // What counts of the medium's light along the ray that cell `c` itself has, at a cosine `weight`
  // from the normal, or 1 on a sphere.
  double share(const DirectionCells& cells, int c, const Vec3d& direction, double weight) const;
  // Estimated variance of the sum of what rays() bring: by how far each is from its neighbours on
  // the same ring.
  double variance(std::span<const double> values) const;

 private:
  struct Source {
    const Light* light;
    Vec3d beam_end{0.0};  // Of a spot: where its axis leaves the medium or meets a surface.
  };
  // A source from one point.
  struct Lamp {
    Lamp(const Source& source, const Vec3d& origin, double cell_width);
    Vec3d direction_at(double h, double turn) const;
    double density(const Vec3d& direction) const;

    Frame around{Vec3d(0.0, 0.0, 1.0)};  // n leads to the lamp, u to the middle of its light.
    double half_turn = kPi;  // How far from u directions near the lamp may see its light [rad].
    double reach = 0;        // Of rays from the lamp's direction [rad].
    double brightness = 0;
    int rings = 0, count = 0;
  };

  std::vector<Source> sources_;
  std::vector<Lamp> lamps_;
  std::vector<LampRay> rays_;
};

}  // namespace brume
