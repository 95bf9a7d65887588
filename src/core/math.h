// Vectors, colours, rays and affine maps, named once for the whole program.
//
// Positions, directions of rays and distances along them are doubles (DESIGN 4.10); floats are for
// storage. Affine maps act on column vectors, as in the scene file: p' = M p + t.
#pragma once

#include <ImathBox.h>
#include <ImathVec.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

namespace brume {

using Vec2f = Imath::V2f;
using Vec2d = Imath::V2d;
using Vec3f = Imath::V3f;
using Vec3d = Imath::V3d;
using Vec3i = Imath::V3i;
using Box3f = Imath::Box3f;
using Box3d = Imath::Box3d;

inline constexpr double kPi = std::numbers::pi;
inline constexpr double kInvPi = std::numbers::inv_pi;
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A linear Rec.709 colour; radiometric unless a name says reflectance.
template <typename T>
struct RgbT {
  T r = 0, g = 0, b = 0;

  constexpr RgbT() = default;
  constexpr explicit RgbT(T grey) : r(grey), g(grey), b(grey) {}
  constexpr RgbT(T r_, T g_, T b_) : r(r_), g(g_), b(b_) {}
  template <typename U>
  constexpr explicit RgbT(const RgbT<U>& c) : r(T(c.r)), g(T(c.g)), b(T(c.b)) {}

  constexpr T operator[](int i) const { return i == 0 ? r : i == 1 ? g : b; }
  constexpr T& operator[](int i) { return i == 0 ? r : i == 1 ? g : b; }
  constexpr RgbT& operator+=(const RgbT& o) { return r += o.r, g += o.g, b += o.b, *this; }
  constexpr RgbT& operator-=(const RgbT& o) { return r -= o.r, g -= o.g, b -= o.b, *this; }
  constexpr RgbT& operator*=(const RgbT& o) { return r *= o.r, g *= o.g, b *= o.b, *this; }
  constexpr RgbT& operator*=(T k) { return r *= k, g *= k, b *= k, *this; }
  friend constexpr RgbT operator+(RgbT a, const RgbT& b) { return a += b; }
  friend constexpr RgbT operator-(RgbT a, const RgbT& b) { return a -= b; }
  friend constexpr RgbT operator*(RgbT a, const RgbT& b) { return a *= b; }
  friend constexpr RgbT operator*(RgbT a, T k) { return a *= k; }
  friend constexpr RgbT operator*(T k, RgbT a) { return a *= k; }
  friend constexpr RgbT operator/(RgbT a, T k) { return {a.r / k, a.g / k, a.b / k}; }
  friend constexpr RgbT operator/(RgbT a, const RgbT& b) { return {a.r / b.r, a.g / b.g, a.b / b.b}; }
  friend constexpr RgbT operator-(const RgbT& a) { return {-a.r, -a.g, -a.b}; }
  friend constexpr bool operator==(const RgbT&, const RgbT&) = default;
};
using Rgb = RgbT<float>;
using RgbD = RgbT<double>;

template <typename T>
constexpr T luminance(const RgbT<T>& c) {
  return T(0.2126) * c.r + T(0.7152) * c.g + T(0.0722) * c.b;
}
template <typename T>
constexpr T max_component(const RgbT<T>& c) {
  return std::max(c.r, std::max(c.g, c.b));
}
template <typename T>
constexpr T mean_component(const RgbT<T>& c) {
  return (c.r + c.g + c.b) / T(3);
}
template <typename T>
constexpr bool is_black(const RgbT<T>& c) {
  return c.r == 0 && c.g == 0 && c.b == 0;
}
template <typename T>
bool is_finite(const RgbT<T>& c) {
  return std::isfinite(c.r) && std::isfinite(c.g) && std::isfinite(c.b);
}
template <typename T>
RgbT<T> exp_neg(const RgbT<T>& tau) {
  return {std::exp(-tau.r), std::exp(-tau.g), std::exp(-tau.b)};
}
inline bool is_finite(const Vec3d& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

// Three gradients, one a channel: what multiplies a displacement to give a colour.
struct RgbGradient {
  Vec3d r{0.0}, g{0.0}, b{0.0};

  RgbGradient& operator+=(const RgbGradient& o) { return r += o.r, g += o.g, b += o.b, *this; }
  RgbGradient& operator-=(const RgbGradient& o) { return r -= o.r, g -= o.g, b -= o.b, *this; }
  friend RgbGradient operator+(RgbGradient a, const RgbGradient& b) { return a += b; }
  friend RgbGradient operator-(RgbGradient a, const RgbGradient& b) { return a -= b; }
  friend RgbGradient operator*(RgbGradient a, double k) { return a.r *= k, a.g *= k, a.b *= k, a; }
  const Vec3d& operator[](int i) const { return i == 0 ? r : i == 1 ? g : b; }
  Vec3d& operator[](int i) { return i == 0 ? r : i == 1 ? g : b; }
  RgbD dot(const Vec3d& d) const { return {r.dot(d), g.dot(d), b.dot(d)}; }
};
// v (x) c: the gradient whose change along d is c (v.d).
inline RgbGradient outer(const RgbD& c, const Vec3d& v) { return {v * c.r, v * c.g, v * c.b}; }
inline Vec3d luminance(const RgbGradient& g) { return g.r * 0.2126 + g.g * 0.7152 + g.b * 0.0722; }

struct Interval {
  double begin = 0, end = kInfinity;
  bool is_empty() const { return !(begin < end); }
};

// `direction` is unit length, so t is a distance.
struct Ray {
  Vec3d origin{0.0}, direction{0.0, 0.0, 1.0};
  Vec3d at(double t) const { return origin + direction * t; }
};

// The part of `t` inside a box; empty when the ray misses. Zero components of either sign are fine;
// a ray along a face counts as inside on the lower face only (half-open boxes).
inline Interval clip(const Ray& ray, const Box3d& box, Interval t) {
  for (int a = 0; a < 3; ++a) {
    const double o = ray.origin[a], d = ray.direction[a];
    if (std::abs(d) < 1e-300) {
      if (!(o >= box.min[a] && o < box.max[a])) return {0, 0};
      continue;
    }
    double t0 = (box.min[a] - o) / d, t1 = (box.max[a] - o) / d;
    if (t0 > t1) std::swap(t0, t1);
    t.begin = std::max(t.begin, t0);
    t.end = std::min(t.end, t1);
  }
  return t.begin < t.end ? t : Interval{0, 0};
}

// p' = M p + t on column vectors; rows of M are m[0..2], t is m[.][3].
struct Affine3d {
  std::array<std::array<double, 4>, 3> m{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};

  Vec3d point(const Vec3d& p) const { return vector(p) + translation(); }
  Vec3d vector(const Vec3d& v) const {
    return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z,
            m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
            m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
  }
  // M^T v: takes gradients from the target space back to the source space.
  Vec3d transposed_vector(const Vec3d& v) const {
    return {m[0][0] * v.x + m[1][0] * v.y + m[2][0] * v.z,
            m[0][1] * v.x + m[1][1] * v.y + m[2][1] * v.z,
            m[0][2] * v.x + m[1][2] * v.y + m[2][2] * v.z};
  }
  Vec3d translation() const { return {m[0][3], m[1][3], m[2][3]}; }
  double determinant() const {
    return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
           m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  }
  // Nothing for a singular or non-finite map.
  std::optional<Affine3d> inverse() const {
    const double d = determinant();
    if (!std::isfinite(d) || d == 0 || !std::isfinite(1 / d)) return std::nullopt;
    Affine3d r;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const int a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, e = (i + 2) % 3;
        r.m[i][j] = (m[a][c] * m[b][e] - m[a][e] * m[b][c]) / d;
      }
    const Vec3d t = r.vector(translation());
    for (int i = 0; i < 3; ++i) r.m[i][3] = -t[i];
    return r;
  }
  friend Affine3d operator*(const Affine3d& a, const Affine3d& b) {
    Affine3d r;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 4; ++j) {
        double s = j == 3 ? a.m[i][3] : 0;
        for (int k = 0; k < 3; ++k) s += a.m[i][k] * b.m[k][j];
        r.m[i][j] = s;
      }
    return r;
  }
  Box3d box(const Box3d& b) const {
    Box3d r;
    for (int i = 0; i < 8; ++i)
      r.extendBy(point({i & 1 ? b.max.x : b.min.x, i & 2 ? b.max.y : b.min.y,
                        i & 4 ? b.max.z : b.min.z}));
    return r;
  }
  friend bool operator==(const Affine3d&, const Affine3d&) = default;
};

// A right-handed frame around a unit normal [DBC*17]; the same normal always gives the same frame.
struct Frame {
  Vec3d u, v, n;
  explicit Frame(const Vec3d& normal) : n(normal) {
    const double s = std::copysign(1.0, n.z), a = -1 / (s + n.z), b = n.x * n.y * a;
    u = {1 + s * n.x * n.x * a, s * b, -s * n.x};
    v = {b, s + n.y * n.y * a, -n.y};
  }
  // The same frame turned by `angle` [rad] about its normal, from u to v.
  Frame turned(double angle) const {
    const double c = std::cos(angle), s = std::sin(angle);
    Frame f = *this;
    f.u = u * c + v * s;
    f.v = v * c - u * s;
    return f;
  }
  Vec3d to_world(const Vec3d& l) const { return u * l.x + v * l.y + n * l.z; }
  Vec3d to_local(const Vec3d& w) const { return {u.dot(w), v.dot(w), n.dot(w)}; }
};

// (1 - exp(-x)) / x for x >= 0, without its 0/0 (gradients.md 7.3).
inline double one_minus_exp_over(double x) { return x > 1e-4 ? -std::expm1(-x) / x : 1 - 0.5 * x; }

}  // namespace brume
