#include "support/plane_slab.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/error.h"

namespace brume::test {

namespace {

// Light scattered twice in a layer is left out of the layers that doubling begins with.
constexpr double kThin = 0x1p-40;

// Legendre polynomials P_0 ... P_{count-1} at x.
std::vector<double> legendre(double x, int count) {
  std::vector<double> p{1, x};
  for (int l = 2; l < count; ++l)
    p.push_back(((2 * l - 1) * x * p[l - 1] - (l - 1) * p[l - 2]) / l);
  p.resize(count);
  return p;
}

// The phase function's Legendre series, sum of (2l+1) g^l P_l, is cut where g^l is below 1e-9.
// Gauss's rule on either half of the sphere integrates 2n terms exactly: then no energy is won or
// lost.
int directions_for(double g) {
  const double terms = g == 0 ? 1 : std::log(1e-9) / std::log(std::abs(g));
  return std::max(48, int(std::ceil(terms / 2)) + 1);
}

}  // namespace

PlaneSlab::Matrix PlaneSlab::Matrix::operator*(const Matrix& b) const {
  Matrix c(n);
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k) {
      const double a = (*this)(i, k);
      for (int j = 0; j < n; ++j) c(i, j) += a * b(k, j);
    }
  return c;
}

PlaneSlab::Matrix& PlaneSlab::Matrix::operator+=(const Matrix& b) {
  for (std::size_t i = 0; i < at.size(); ++i) at[i] += b.at[i];
  return *this;
}

// Gauss elimination with pivots.
PlaneSlab::Matrix PlaneSlab::Matrix::solve(Matrix b) const {
  Matrix a = *this;
  for (int k = 0; k < n; ++k) {
    int pivot = k;
    for (int i = k + 1; i < n; ++i)
      if (std::abs(a(i, k)) > std::abs(a(pivot, k))) pivot = i;
    for (int j = 0; j < n; ++j) {
      std::swap(a(k, j), a(pivot, j));
      std::swap(b(k, j), b(pivot, j));
    }
    for (int i = k + 1; i < n; ++i) {
      const double f = a(i, k) / a(k, k);
      for (int j = k; j < n; ++j) a(i, j) -= f * a(k, j);
      for (int j = 0; j < n; ++j) b(i, j) -= f * b(k, j);
    }
  }
  for (int k = n - 1; k >= 0; --k)
    for (int j = 0; j < n; ++j) {
      for (int i = k + 1; i < n; ++i) b(k, j) -= a(k, i) * b(i, j);
      b(k, j) /= a(k, k);
    }
  return b;
}

PlaneSlab::PlaneSlab(int directions) : reflection_(directions + 1), transmission_(directions + 1) {
  for (int i = 0; i < directions; ++i) {
    // Newton's method from a known estimate of the i-th root of P_n.
    double x = std::cos(std::numbers::pi * (i + 0.75) / (directions + 0.5)), slope = 1;
    for (int step = 0; step < 8; ++step) {
      const std::vector<double> p = legendre(x, directions + 1);
      slope = directions * (x * p[directions] - p[directions - 1]) / (x * x - 1);
      x -= p[directions] / slope;
    }
    mu_.push_back((1 + x) / 2);
    weight_.push_back(1 / ((1 - x * x) * slope * slope));
  }
  mu_.push_back(1);
  weight_.push_back(0);
}

PlaneSlab::PlaneSlab(double optical_depth, double albedo, double g) : PlaneSlab(directions_for(g)) {
  BRUME_ASSERT(optical_depth, >, 0);
  BRUME_ASSERT(std::abs(albedo - 0.5), <=, 0.5);
  BRUME_ASSERT(std::abs(g), <, 0.95);
  int doublings = 0;
  for (optical_depth_ = optical_depth; optical_depth_ > kThin; optical_depth_ /= 2) ++doublings;
  make_thin(g, albedo);
  for (int i = 0; i < doublings; ++i) *this = on_top_of(*this);
}

// Light scattered once [vdH80, chapter 4]. For uniform incident radiance that of light leaving
// along mu is the integral over mu' of albedo/2 h(mu, mu') mu'/(mu + mu') (1 - exp(-tau (1/mu +
// 1/mu'))) with h the phase function averaged over azimuth, of mean 1. In a layer this thin the
// bracket and its counterpart below are tau (1/mu + 1/mu') to the first order: both sides then
// scatter alike.
void PlaneSlab::make_thin(double g, double albedo) {
  const int n = int(mu_.size()), terms = 2 * (n - 1);
  std::vector<std::vector<double>> p;
  for (const double mu : mu_) p.push_back(legendre(mu, terms));
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      double back = 0, on = 0, power = 1;
      for (int l = 0; l < terms; ++l, power *= g) {
        const double term = (2 * l + 1) * power * p[i][l] * p[j][l];
        on += term;
        back += l % 2 ? -term : term;
      }
      // weight is Gauss's on (0, 1), whose sum is 1.
      const double scale = albedo / 2 * optical_depth_ / mu_[i] * weight_[j];
      reflection_(i, j) = scale * back;
      transmission_(i, j) = scale * on;
    }
}

double PlaneSlab::beam(int i) const { return std::exp(-optical_depth_ / mu_[i]); }

PlaneSlab::Matrix PlaneSlab::whole_transmission() const {
  Matrix t = transmission_;
  for (int i = 0; i < t.n; ++i) t(i, i) += beam(i);
  return t;
}

// With r the reflection and t the whole transmission of a layer, 1 above 2, and light going to and
// fro between them summed by s = (1 - r1 r2)^-1 r1 r2:
//   R = r1 + t1 r2 (1 + s) t1, T = t2 (1 + s) t1.
// A slab of one medium looks alike from both sides, so r and t need no side.
PlaneSlab PlaneSlab::on_top_of(const PlaneSlab& below) const {
  const int n = reflection_.n;
  BRUME_ASSERT(n, ==, below.reflection_.n);
  const Matrix t1 = whole_transmission(), t2 = below.whole_transmission();
  const Matrix rr = reflection_ * below.reflection_;
  Matrix rest(n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) rest(i, j) = (i == j ? 1 : 0) - rr(i, j);
  const Matrix again = rest.solve(rr) * t1;
  Matrix down = t1;
  down += again;

  PlaneSlab both = *this;
  both.optical_depth_ = optical_depth_ + below.optical_depth_;
  both.reflection_ += t1 * (below.reflection_ * down);
  // t2 t1 without the product of the two beams.
  both.transmission_ = below.transmission_ * t1;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) both.transmission_(i, j) += below.beam(i) * transmission_(i, j);
  both.transmission_ += t2 * again;
  return both;
}

// By reciprocity: what uniform radiance 1 makes leave along the normal is the part that leaves in
// all directions of light that arrives along it.
SlabFluxes PlaneSlab::normal() const {
  const int last = int(mu_.size()) - 1;
  SlabFluxes f;
  f.unscattered = f.transmitted = beam(last);
  for (int j = 0; j < last; ++j) {
    f.reflected += reflection_(last, j);
    f.transmitted += transmission_(last, j);
  }
  return f;
}

SlabFluxes PlaneSlab::diffuse() const {
  const int directions = int(mu_.size()) - 1;
  SlabFluxes f;
  for (int i = 0; i < directions; ++i) {
    const double flux = 2 * mu_[i] * weight_[i];
    f.unscattered += flux * beam(i);
    for (int j = 0; j < directions; ++j) {
      f.reflected += flux * reflection_(i, j);
      f.transmitted += flux * transmission_(i, j);
    }
  }
  f.transmitted += f.unscattered;
  return f;
}

double PlaneSlab::asymmetry() const {
  const int directions = int(mu_.size()) - 1;
  double worst = 0;
  for (const Matrix* m : {&reflection_, &transmission_}) {
    double most = 0, largest = 0;
    // As functions of two directions: per weighted cosine of the incident one.
    const auto value = [&](int i, int j) { return (*m)(i, j) / (mu_[j] * weight_[j]); };
    for (int i = 0; i < directions; ++i)
      for (int j = 0; j < directions; ++j) {
        most = std::max(most, std::abs(value(i, j) - value(j, i)));
        largest = std::max(largest, std::abs(value(i, j)));
      }
    worst = std::max(worst, most / largest);
  }
  return worst;
}

}  // namespace brume::test
