// Points of a plane lattice whose steps are powers of 1 over the plastic number [Rob18]: any run of
// them is even.
#pragma once

#include <cmath>

#include "core/math.h"

namespace brume {

// Powers of the inverse of the real root of x^3 = x + 1.
constexpr double kLatticeX = 0.7548776662466927, kLatticeY = 0.5698402909980532;

// Point `i` of [0,1)^2, of the lattice that `shift` moves.
inline Vec2d lattice_point(double i, const Vec2d& shift) {
  const double x = shift.x + i * kLatticeX, y = shift.y + i * kLatticeY;
  return {x - std::floor(x), y - std::floor(y)};
}

}  // namespace brume
