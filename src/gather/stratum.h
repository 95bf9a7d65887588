// What a gather keeps of each stratum so that it can be shaded again with other light: the rays, the
// marching and the lamps are paid for once, a further bounce costs lookups alone.
#pragma once

#include <vector>

#include "core/math.h"

namespace brume {

// One stratum of a gather. Only those whose ray ends on a surface that reflects are kept.
struct Stratum {
  float direction[3];    // From the receiver; unit, world space.
  float distance;        // To the hit.
  float normal[3];       // Of the hit, on the side that reflects towards the receiver.
  float measure;         // Of the stratum, in the receiver's integral.
  float reflectance[3];  // Transmittance * albedo / pi: radiance for each W/m^2 at the hit.

  Vec3d hit(const Vec3d& receiver) const {
    return receiver + Vec3d(direction[0], direction[1], direction[2]) * double(distance);
  }
};

}  // namespace brume
