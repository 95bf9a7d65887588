// More rays where cells are too wide. A gather looks past a lamp in a medium: at an angle h from
// the lamp's direction the light that the medium scatters goes as 1/h, whose square no cell can
// integrate, so a ray that happens to pass close by would make a record far too bright
// (docs/decisions/0011). And surfaces hold small places that are much brighter than the rest
// (docs/decisions/0013).
#pragma once

#include <span>
#include <vector>

#include "core/random.h"
#include "gather/bright_patches.h"
#include "gather/direction_cells.h"
#include "plan/effects.h"
#include "scene/world.h"

namespace brume {

// A ray besides those of the cells. What comes along it counts `share`, in the mean of its cell.
struct GuidedRay {
  Vec3d direction{0.0};  // World space.
  int cell = 0;
  double share = 0;
  int target = 0, stratum = 0;  // Of what it is drawn for.
};

// Towards point and spot lamps in a medium, evenly in h, as dense as 1/h, out to a few cells from a
// lamp, or along all of a beam that is seen from its side; and towards bright patches, evenly over
// them. Rays of cells and these share a cell by the balance heuristic, so that nothing is lost
// or counted twice. Scratch memory of one thread.
class GuidedRays {
 public:
  // The patches must outlive it.
  GuidedRays(const World& world, const Effects& effects, const BrightPatches& patches);

  // `frame` turns local directions into the world. To patches only where surfaces reflect.
  void draw(const Vec3d& origin, const Frame& frame, const DirectionCells& cells, bool reflects,
            const RandomStream& random, Counters& counters);

  std::span<const GuidedRay> rays() const { return rays_; }
  // What counts of the light along the ray that cell `c` itself has, at a cosine `weight` from the
  // normal, or 1 on a sphere.
  double share(const DirectionCells& cells, int c, const Vec3d& direction, double weight) const;
  // Estimated variance of the sum of what rays() bring: by how far each is from its neighbours on
  // the same ring, or from the next of its patch.
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
    double sine_of_reach = 0;
    double brightness = 0;
    int rings = 0, count = 0;
  };

  // A patch from one point.
  struct Panel {
    Panel(const BrightPatch& patch, const Vec3d& origin, int count);
    Vec3d direction_at(const Vec2d& u) const;
    double density(const Vec3d& direction) const;

    BrightPatch patch;
    Vec3d centre{0.0};         // From the point.
    double plane = 0;          // normal . centre.
    Vec3d across_u, across_v;  // u / u.u, v / v.v.
    double area = 0;
    int count = 0;
  };

  void draw_lamps(const Vec3d& origin, const Frame& frame, const DirectionCells& cells,
                  RandomStream random);
  void draw_patches(const Vec3d& origin, const Frame& frame, const DirectionCells& cells,
                    const RandomStream& random, Counters& counters);
  void add(const Vec3d& direction, const Frame& frame, const DirectionCells& cells, int target,
           int stratum);
  double variance_of_rings(const Lamp& lamp, std::span<const double> of_stratum) const;

  std::vector<Source> sources_;
  const BrightPatches& patches_;
  std::vector<BrightPatch> visible_;
  // Targets are the lamps, then the panels.
  std::vector<Lamp> lamps_;
  std::vector<Panel> panels_;
  std::vector<GuidedRay> rays_;
};

}  // namespace brume
