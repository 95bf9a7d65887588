#include "vdb_media/phase_function.h"

#include <string>

#include "core/error.h"

namespace brume {
namespace {

// 1 + g^2 - 2 g cos, as a sum of terms that are never negative, so that nothing cancels: with
// 1 - cos = |in - out|^2 / 2 and 1 + cos = |in + out|^2 / 2 (HARD_CASES 4.2). The second form
// serves g < 0, where the lobe is at `in == -out`.
double denominator(double g, const Vec3d& in, const Vec3d& out) {
  const double a = 1 - std::abs(g);
  return a * a + std::abs(g) * (g < 0 ? in + out : in - out).length2();
}

}  // namespace

HenyeyGreenstein::HenyeyGreenstein(double g) : g_(g) {
  if (!(g > -1 && g < 1))
    throw Error(ErrorKind::InvalidInput,
                "anisotropy: " + std::to_string(g) + " is outside (-1, 1): choose one inside");
}

double HenyeyGreenstein::eval(const Vec3d& in, const Vec3d& out) const {
  const double d = denominator(g_, in, out);
  return (1 - g_) * (1 + g_) / (4 * kPi * d * std::sqrt(d));
}

PhaseValue HenyeyGreenstein::eval_with_derivative(const Vec3d& in, const Vec3d& out) const {
  const double d = denominator(g_, in, out);
  const double p = (1 - g_) * (1 + g_) / (4 * kPi * d * std::sqrt(d));
  return {p, 3 * g_ * p / d};
}

PhaseSample HenyeyGreenstein::sample(const Vec3d& in, const Vec2d& u) const {
  // The usual inverse cos = (1 + g^2 - ((1 - g^2) / q)^2) / (2 g), q = 1 - g + 2 g u, solved for
  // w = 1 - cos: the 2 g cancels, so that neither a narrow lobe nor g -> 0 loses digits. A negative
  // g is the lobe of |g| around the opposite direction.
  const double g = std::abs(g_);
  const double q = (1 - g) + 2 * g * u.x;
  const double w = 2 * (1 - g) * (1 - g) * (1 - u.x) * (1 + g * u.x) / (q * q);
  const double sine = std::sqrt(std::max(0.0, w * (2 - w))), phi = 2 * kPi * u.y;
  const Frame frame(in);
  const Vec3d axis = g_ < 0 ? -in : in;
  const Vec3d direction =
      axis * (1 - w) + frame.u * (sine * std::cos(phi)) + frame.v * (sine * std::sin(phi));
  return {direction, eval(in, direction)};
}

}  // namespace brume
