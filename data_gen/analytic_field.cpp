#include "data_gen/analytic_field.h"

#include "core/error.h"
#include "core/parallel.h"

namespace brume {

namespace {

// Part of [0, 1] along a..b that lies in a closed box or ball, as a length in world units.
double length_inside(const ConstantBox& f, const Vec3d& a, const Vec3d& b) {
  double begin = 0, end = 1;
  for (int k = 0; k < 3; ++k) {
    const double d = b[k] - a[k];
    if (d == 0) {
      if (a[k] < f.box.min[k] || a[k] > f.box.max[k]) return 0;
      continue;
    }
    const double t0 = (f.box.min[k] - a[k]) / d, t1 = (f.box.max[k] - a[k]) / d;
    begin = std::max(begin, std::min(t0, t1));
    end = std::min(end, std::max(t0, t1));
  }
  return std::max(0.0, end - begin) * (b - a).length();
}

double length_inside(const ConstantBall& f, const Vec3d& a, const Vec3d& b) {
  const double length = (b - a).length();
  if (length == 0) return 0;
  const Vec3d d = (b - a) / length;
  const double along = (f.centre - a).dot(d);
  const double off2 = (a + d * along - f.centre).length2();
  if (off2 >= f.radius * f.radius) return 0;
  const double half = std::sqrt(f.radius * f.radius - off2);
  return std::max(0.0, std::min(length, along + half) - std::max(0.0, along - half));
}

struct Density {
  const Vec3d& p;

  double operator()(const ConstantBox& f) const { return f.box.intersects(p) ? f.density : 0; }
  double operator()(const ConstantBall& f) const {
    return (p - f.centre).length2() <= f.radius * f.radius ? f.density : 0;
  }
  double operator()(const LinearRamp& f) const {
    return std::max(0.0, f.density_at_origin + f.slope.dot(p));
  }
  double operator()(const ExponentialAtmosphere& f) const {
    return f.density_at_ground * std::exp(-(f.up.dot(p) - f.ground) / f.scale_height);
  }
  double operator()(const GaussianSum& f) const {
    double sum = f.background;
    for (const GaussianBump& g : f.bumps)
      sum += g.amplitude * std::exp(-(p - g.centre).length2() / (2 * g.width * g.width));
    return sum;
  }
  double operator()(const SmokePlume& f) const { return plume_density(f, p); }
  double operator()(const Dust& f) const { return dust_density(f, p); }
};

struct Gradient {
  const Vec3d& p;

  std::optional<Vec3d> operator()(const ConstantBox&) const { return Vec3d(0.0); }
  std::optional<Vec3d> operator()(const ConstantBall&) const { return Vec3d(0.0); }
  std::optional<Vec3d> operator()(const LinearRamp& f) const {
    return f.density_at_origin + f.slope.dot(p) > 0 ? f.slope : Vec3d(0.0);
  }
  std::optional<Vec3d> operator()(const ExponentialAtmosphere& f) const {
    return f.up * (-Density{p}(f) / f.scale_height);
  }
  std::optional<Vec3d> operator()(const GaussianSum& f) const {
    Vec3d sum(0.0);
    for (const GaussianBump& g : f.bumps) {
      const Vec3d d = p - g.centre;
      const double s2 = g.width * g.width;
      sum -= d * (g.amplitude * std::exp(-d.length2() / (2 * s2)) / s2);
    }
    return sum;
  }
  std::optional<Vec3d> operator()(const SmokePlume&) const { return std::nullopt; }
  std::optional<Vec3d> operator()(const Dust&) const { return std::nullopt; }
};

struct LineIntegral {
  const Vec3d &a, &b;

  std::optional<double> operator()(const ConstantBox& f) const {
    return f.density * length_inside(f, a, b);
  }
  std::optional<double> operator()(const ConstantBall& f) const {
    return f.density * length_inside(f, a, b);
  }
  std::optional<double> operator()(const LinearRamp& f) const {
    const double da = f.density_at_origin + f.slope.dot(a);
    const double db = f.density_at_origin + f.slope.dot(b);
    const double length = (b - a).length(), high = std::max(da, db), low = std::min(da, db);
    if (high <= 0) return 0;
    if (low >= 0) return length * (da + db) / 2;
    return length * high * high / (2 * (high - low));  // The triangle above zero.
  }
  std::optional<double> operator()(const ExponentialAtmosphere& f) const {
    // (d_a - d_b) / rate, without the cancellation of a nearly level way.
    const double rise = f.up.dot(b - a) / f.scale_height;
    const double start = Density{rise >= 0 ? a : b}(f), x = std::abs(rise);
    return start * (b - a).length() * (x > 0 ? -std::expm1(-x) / x : 1);
  }
  std::optional<double> operator()(const GaussianSum& f) const {
    const double length = (b - a).length();
    double sum = f.background * length;
    if (length == 0) return sum;
    const Vec3d d = (b - a) / length;
    for (const GaussianBump& g : f.bumps) {
      // Nearest to the centre at t = along; across it the bump is one-dimensional.
      const double along = (g.centre - a).dot(d);
      const double off2 = (a + d * along - g.centre).length2();
      const double scale = g.width * std::numbers::sqrt2;
      sum += g.amplitude * std::exp(-off2 / (scale * scale)) * g.width * std::sqrt(kPi / 2) *
             (std::erf((length - along) / scale) + std::erf(along / scale));
    }
    return sum;
  }
  std::optional<double> operator()(const SmokePlume&) const { return std::nullopt; }
  std::optional<double> operator()(const Dust&) const { return std::nullopt; }
};

}  // namespace

GaussianSum three_gaussians(double background) {
  return {
      background,
      {{{0.4, -0.3, 0.9}, 1.2, 0.45}, {{-0.7, 0.5, 0.5}, 0.9, 0.35}, {{0.1, 0.9, 1.4}, 0.8, 0.5}}};
}

double density(const AnalyticField& field, const Vec3d& p) { return std::visit(Density{p}, field); }

std::optional<Vec3d> density_gradient(const AnalyticField& field, const Vec3d& p) {
  return std::visit(Gradient{p}, field);
}

std::optional<double> line_integral(const AnalyticField& field, const Vec3d& a, const Vec3d& b) {
  return std::visit(LineIntegral{a, b}, field);
}

Affine3d Lattice::index_to_world() const {
  Affine3d map;
  for (int a = 0; a < 3; ++a) {
    map.m[a][a] = step;
    map.m[a][3] = origin[a];
  }
  return map;
}

Lattice covering_lattice(const Box3d& bounds, double step) {
  if (!(step > 0) || !std::isfinite(step))
    throw Error(ErrorKind::InvalidInput, "lattice: step: " + std::to_string(step) +
                                             " is not a positive length: give a larger one");
  Lattice lattice{bounds.min, step, Vec3i(1)};
  double nodes = 1;
  for (int a = 0; a < 3; ++a) {
    const double extent = bounds.max[a] - bounds.min[a];
    if (!(extent > 0) || !std::isfinite(extent))
      throw Error(ErrorKind::InvalidInput,
                  "lattice: bounds: the minimum is not below the maximum: exchange them");
    // The margin keeps an extent that is a multiple of the step from gaining a node by rounding.
    const double cells = std::ceil(extent / step - 1e-6);
    nodes *= cells + 1;
    if (nodes > 0x1p31)
      throw Error(ErrorKind::InvalidInput,
                  "lattice: step: more than 2^31 nodes: give a longer step or smaller bounds");
    lattice.count[a] = static_cast<int>(cells) + 1;
  }
  return lattice;
}

std::vector<float> sample_field(const AnalyticField& field, const Lattice& lattice, int threads) {
  const Vec3i n = lattice.count;
  std::vector<float> values(std::size_t(n.x) * n.y * n.z);
  parallel_for(threads, std::size_t(n.y) * n.z, 8, [&](std::size_t row) {
    const int j = static_cast<int>(row % n.y), k = static_cast<int>(row / n.y);
    for (int i = 0; i < n.x; ++i)
      values[row * n.x + i] = static_cast<float>(density(field, lattice.node({i, j, k})));
  });
  return values;
}

}  // namespace brume
