#include "data_gen/noise.h"

#include "core/random.h"

namespace brume {

namespace {

// The twelve edges of a cube, four of them twice, so that four bits choose one.
constexpr std::array<std::array<double, 3>, 16> kEdges{{{1, 1, 0},
                                                        {-1, 1, 0},
                                                        {1, -1, 0},
                                                        {-1, -1, 0},
                                                        {1, 0, 1},
                                                        {-1, 0, 1},
                                                        {1, 0, -1},
                                                        {-1, 0, -1},
                                                        {0, 1, 1},
                                                        {0, -1, 1},
                                                        {0, 1, -1},
                                                        {0, -1, -1},
                                                        {1, 1, 0},
                                                        {-1, 1, 0},
                                                        {0, -1, 1},
                                                        {0, -1, -1}}};

double fade(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }
double fade_slope(double t) { return 30 * t * t * (t - 1) * (t - 1); }

}  // namespace

GradientNoise::Sample GradientNoise::at(const Vec3d& p) const {
  const double cell[3] = {std::floor(p.x), std::floor(p.y), std::floor(p.z)};
  const double t[3] = {p.x - cell[0], p.y - cell[1], p.z - cell[2]};
  // Weight of the lower and the upper corner on each axis, and its slope.
  double weight[3][2], slope[3][2];
  for (int a = 0; a < 3; ++a) {
    weight[a][1] = fade(t[a]);
    weight[a][0] = 1 - weight[a][1];
    slope[a][1] = fade_slope(t[a]);
    slope[a][0] = -slope[a][1];
  }
  Sample sum;
  for (int corner = 0; corner < 8; ++corner) {
    const int c[3] = {corner & 1, (corner >> 1) & 1, corner >> 2};
    const std::uint64_t bits =
        random_key(seed_, std::int64_t(cell[0]) + c[0], std::int64_t(cell[1]) + c[1],
                   std::int64_t(cell[2]) + c[2]);
    const auto& g = kEdges[bits & 15];
    const double v = g[0] * (t[0] - c[0]) + g[1] * (t[1] - c[1]) + g[2] * (t[2] - c[2]);
    const double wx = weight[0][c[0]], wy = weight[1][c[1]], wz = weight[2][c[2]];
    const double w = wx * wy * wz;
    sum.value += w * v;
    sum.gradient +=
        Vec3d(w * g[0] + slope[0][c[0]] * wy * wz * v, w * g[1] + wx * slope[1][c[1]] * wz * v,
              w * g[2] + wx * wy * slope[2][c[2]] * v);
  }
  return sum;
}

double GradientNoise::fractal(const Vec3d& p, int octaves, double gain) const {
  double sum = 0, total = 0, amplitude = 1;
  Vec3d q = p;
  for (int i = 0; i < octaves; ++i) {
    sum += amplitude * value(q);
    total += amplitude;
    amplitude *= gain;
    // Off the lattice of the octave before, whose zeros would otherwise coincide.
    q = q * 2.0 + Vec3d(17.31, 5.77, 29.13);
  }
  return sum / total;
}

CurlNoise::CurlNoise(std::uint64_t seed)
    : x_(random_key(seed, 1)), y_(random_key(seed, 2)), z_(random_key(seed, 3)) {}

Vec3d CurlNoise::velocity(const Vec3d& p) const {
  const Vec3d gx = x_.at(p).gradient, gy = y_.at(p).gradient, gz = z_.at(p).gradient;
  return {gz.y - gy.z, gx.z - gz.x, gy.x - gx.y};
}

}  // namespace brume
