// Real spherical harmonics, scaled so that the first is 1: the mean over the sphere of the product of
// two is 1 for the same and 0 for others, and sum over m of Y_lm(a) Y_lm(b) = (2l + 1) P_l(a.b).
//
// With moments M_lm = int L(w) Y_lm(w) dw, M_00 is the fluence, and a phase function with Legendre
// coefficients g^l (Henyey-Greenstein's) scatters sum g^l Y_lm(w) M_lm / (4 pi) towards -w, where
// all directions look away from the point.
#pragma once

#include <array>

#include "core/math.h"

namespace brume {

inline constexpr int kMaxHarmonicOrder = 5;
inline constexpr int harmonic_count(int order) { return (order + 1) * (order + 1); }
inline constexpr int kMaxHarmonics = harmonic_count(kMaxHarmonicOrder);

// Values of one direction, [l^2 + l + m].
using Harmonics = std::array<double, kMaxHarmonics>;

// Those of degrees up to `order`, for a unit `w`; the rest of the array is left alone.
inline void evaluate_harmonics(int order, const Vec3d& w, Harmonics& y) {
  y[0] = 1;
  if (order == 0) return;
  // sin^m cos(m phi) and sin^m sin(m phi) by rotation; P_l^m / sin^m by its recurrence in l. The
  // signs of Condon and Shortley are left out: only products of two matter.
  double cos_m = 1, sin_m = 0, top = 1;  // top = P_m^m / sin^m = (2m - 1)!!
  double factorials = 1;                 // (2m)!
  for (int m = 0; m <= order; ++m) {
    if (m > 0) {
      const double c = cos_m * w.x - sin_m * w.y;
      sin_m = cos_m * w.y + sin_m * w.x;
      cos_m = c;
      top *= 2 * m - 1;
      factorials *= double(2 * m) * (2 * m - 1);
    }
    double below = 0, p = top, ratio = 1 / factorials;  // ratio = (l - m)! / (l + m)!
    for (int l = m; l <= order; ++l) {
      const double scale = std::sqrt((m > 0 ? 2.0 : 1.0) * (2 * l + 1) * ratio) * p;
      y[l * l + l + m] = scale * cos_m;
      if (m > 0) y[l * l + l - m] = scale * sin_m;
      const double next = ((2 * l + 1) * w.z * p - (l + m) * below) / (l - m + 1);
      below = p;
      p = next;
      ratio *= double(l + 1 - m) / (l + 1 + m);
    }
  }
}

}  // namespace brume
