// Phase functions: how the direction of light changes where a medium scatters it.
//
// Every direction in this header points the way the light travels, so `in == out` means "carries
// straight on". Surface code points both directions away from the surface; negate one on the way in.
#pragma once

#include "core/math.h"

namespace brume {

struct PhaseSample {
  Vec3d direction{0.0};  // Unit length.
  double pdf = 0;        // [1/sr]
};

struct PhaseValue {
  double p = 0;           // [1/sr]
  double derivative = 0;  // dp / d cos.
};

// The one-parameter model of [HG41]. `g` is the mean cosine of the scattering angle: backward for
// g < 0, isotropic at 0, forward for g > 0. Accurate to 4e-7 up to |g| = 0.99999 (HARD_CASES 4.2),
// because it takes both directions and uses 1 - cos = |in - out|^2 / 2.
class HenyeyGreenstein {
 public:
  // Throws Error(InvalidInput) unless -1 < g < 1; at the ends p is a delta.
  explicit HenyeyGreenstein(double g = 0);

  double g() const { return g_; }
  bool is_isotropic() const { return g_ == 0; }

  // p = (1 - g^2) / (4 pi (1 + g^2 - 2 g cos)^(3/2))  [1/sr]
  double eval(const Vec3d& in, const Vec3d& out) const;
  // The same with its derivative by the cosine between `in` and `out`, at the cost of a division.
  PhaseValue eval_with_derivative(const Vec3d& in, const Vec3d& out) const;
  // Draws from p exactly, so pdf == eval(in, direction).
  PhaseSample sample(const Vec3d& in, const Vec2d& u) const;

 private:
  double g_;
};

}  // namespace brume
