// Reflection and transmission of a plane-parallel slab to many digits, by doubling [vdH80,
// chapter 4]: what media in boxes and grids are held to. It shares no code with what it judges.
//
// The slab is endless to the sides, in vacuum, and lit from above only. Radiance is averaged over
// azimuth, which leaves fluxes exact. Only the optical depth matters, not how it is spread over the
// slab's thickness. Results are parts of the flux that arrives.
#pragma once

#include <vector>

namespace brume::test {

struct SlabFluxes {
  double reflected = 0;
  double transmitted = 0;  // All that leaves below.
  double unscattered = 0;  // The part of `transmitted` that met nothing.
};

// Good to about 1e-6 for optical depths from 1e-4 to 1e3 and |g| up to 0.9.
class PlaneSlab {
 public:
  // Optical depth along the normal, positive; albedo in [0, 1]; g of Henyey-Greenstein in
  // (-0.95, 0.95): closer to 1 the phase function needs more directions than are kept. A slab takes
  // milliseconds at g = 0 and a few tenths of a second at 0.9.
  PlaneSlab(double optical_depth, double albedo, double g = 0);

  SlabFluxes normal() const;   // A collimated beam along the normal.
  SlabFluxes diffuse() const;  // The same radiance from all directions above.

  // This slab and `below` of the same medium as one, by the adding equations.
  PlaneSlab on_top_of(const PlaneSlab& below) const;

  // The largest |R(i,j) - R(j,i)| and |T(i,j) - T(j,i)| between directions, over the largest R, T.
  double asymmetry() const;

 private:
  struct Matrix {
    int n = 0;
    std::vector<double> at;  // Row-major.
    explicit Matrix(int size) : n(size), at(std::size_t(size) * size) {}
    double& operator()(int i, int j) { return at[std::size_t(i) * n + j]; }
    double operator()(int i, int j) const { return at[std::size_t(i) * n + j]; }
    Matrix operator*(const Matrix& b) const;
    Matrix& operator+=(const Matrix& b);
    Matrix solve(Matrix b) const;  // x of (*this) x = b.
  };

  explicit PlaneSlab(int directions);
  void make_thin(double g, double albedo);
  double beam(int i) const;
  Matrix whole_transmission() const;

  double optical_depth_ = 0;
  // Cosines to the normal and weights of Gauss's rule on (0, 1), and last the normal itself with
  // weight 0: what leaves along it is found, and feeds nothing back.
  std::vector<double> mu_, weight_;
  // Act on radiances at mu_, and give radiances that left up and, scattered, down. The unscattered
  // beam is kept apart: beside it a thin layer's scattering would drown in rounding.
  Matrix reflection_, transmission_;
};

}  // namespace brume::test
