// What a gather keeps of each stratum so that it can be shaded again with other light: the rays, the
// marching and the lamps are paid for once, a further bounce or scattering costs lookups alone.
#pragma once

#include <vector>

#include "core/math.h"

namespace brume {

// A point of the medium that stands for a stretch of a stratum's ray.
struct MediumPoint {
  float distance;        // From the receiver.
  std::uint32_t volume;  // Whose phase function scatters.
  float weight[3];       // The stretch's integral of transmittance * sigma_s.
};

// One stratum of a gather whose ray ends on a surface that reflects or meets a medium that scatters.
struct Stratum {
  float direction[3];    // From the receiver; unit, world space.
  float measure;         // Of the stratum, in the receiver's integral.
  float distance;        // To the hit.
  float normal[3];       // Of the hit, on the side that reflects towards the receiver.
  float reflectance[3];  // Transmittance * albedo / pi: radiance for each W/m^2 at the hit; 0 without one.
  std::uint32_t points_end;  // Of its points; they begin where those of the stratum before end.

  Vec3d way() const { return {direction[0], direction[1], direction[2]}; }
  bool reflects() const { return reflectance[0] > 0 || reflectance[1] > 0 || reflectance[2] > 0; }
};

struct Strata {
  std::vector<Stratum> strata;
  std::vector<MediumPoint> points;
  double spread = 0;  // Half the width of a stratum [rad].
};

}  // namespace brume
