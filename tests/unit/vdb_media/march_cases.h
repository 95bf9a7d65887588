// Grids with known fields, and a slow marcher to hold the fast one against.
#pragma once

#include <algorithm>
#include <functional>
#include <memory>
#include <vector>

#include "core/math.h"
#include "core/random.h"
#include "core/sampling.h"
#include "vdb_media/medium.h"

namespace brume::march_cases {

using Function = std::function<double(const Vec3d&)>;

// Nodes first..first+count-1 filled with f at their world positions.
inline std::shared_ptr<const BrickGrid> make_grid(const Vec3i& first, const Vec3i& count,
                                                  const Affine3d& index_to_world,
                                                  const Function& f) {
  std::vector<float> values;
  for (int z = 0; z < count.z; ++z)
    for (int y = 0; y < count.y; ++y)
      for (int x = 0; x < count.x; ++x)
        values.push_back(
            float(f(index_to_world.point(Vec3d(first.x + x, first.y + y, first.z + z)))));
  return BrickGrid::from_dense(first, count, values, index_to_world);
}

inline Volume make_volume(std::shared_ptr<const BrickGrid> grid, const RgbD& sigma_t = RgbD(1.0)) {
  Volume v;
  v.density = std::move(grid);
  v.sigma_a = sigma_t;
  return v;
}

inline Volume make_box(const Vec3d& min, const Vec3d& max, const RgbD& sigma_t = RgbD(1.0)) {
  Volume v;
  v.bounds = Box3d(min, max);
  v.sigma_a = sigma_t;
  return v;
}

inline Affine3d scaling(const Vec3d& s, const Vec3d& translation = Vec3d(0.0)) {
  Affine3d m;
  for (int a = 0; a < 3; ++a) {
    m.m[a][a] = s[a];
    m.m[a][3] = translation[a];
  }
  return m;
}

// A lumpy, noisy ball of about 60 voxels across with holes in it, so that bricks of every kind
// occur.
inline std::shared_ptr<const BrickGrid> make_lumps(const Affine3d& index_to_world) {
  const Vec3i first(-7, 3, -20), count(70, 61, 66);
  std::vector<float> values;
  RandomStream random(random_key(11));
  for (int z = 0; z < count.z; ++z)
    for (int y = 0; y < count.y; ++y)
      for (int x = 0; x < count.x; ++x) {
        const Vec3d q((x - 34) / 30.0, (y - 30) / 28.0, (z - 33) / 31.0);
        const double r = q.length();
        const double noise = 0.5 + random.uniform();
        const bool core = r < 0.45;  // Constant inside: tiles.
        const bool hole = r > 0.55 && r < 0.8 && q.x > 0;
        values.push_back(core ? 0.7f : hole || r > 1 ? 0.0f : float((1 - r) * noise));
      }
  return BrickGrid::from_dense(first, count, values, index_to_world);
}

// A map with everything in it: mirrored, sheared, unequal voxels, moved.
inline Affine3d crooked_map() {
  Affine3d m;
  m.m = {{{-0.11, 0.02, 0.01, 3}, {0.015, 0.09, -0.03, -2}, {0.0, 0.04, 0.13, 5}}};
  return m;
}

// A segment from a sphere around the box to a point in it, prolonged beyond.
inline Ray random_ray(const Box3d& box, RandomStream& random) {
  const Vec3d target =
      box.min + (box.max - box.min) * Vec3d(random.uniform(), random.uniform(), random.uniform());
  const Vec3d origin =
      box.center() + sample_sphere(random.uniform2()) * (0.7 * (box.max - box.min).length());
  return {origin, (target - origin).normalized()};
}

// Integrates g over [begin, end] between all the places where the ray crosses a plane of nodes,
// with three Gauss points in double: exact for polynomials of degree 5 in a cell.
template <typename T>
T integrate_by_cells(const BrickGrid& grid, const Ray& ray, double begin, double end,
                     const std::function<T(double)>& g, T sum) {
  const Vec3d o = grid.world_to_index().point(ray.origin);
  const Vec3d d = grid.world_to_index().vector(ray.direction);
  std::vector<double> cuts{begin, end};
  for (int a = 0; a < 3; ++a) {
    if (d[a] == 0) continue;
    for (double p = std::floor(grid.index_bounds().min[a]); p <= grid.index_bounds().max[a]; ++p) {
      const double t = (p - o[a]) / d[a];
      if (t > begin && t < end) cuts.push_back(t);
    }
  }
  std::sort(cuts.begin(), cuts.end());
  const double kNode = std::sqrt(0.6);
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
    const double c = (cuts[i] + cuts[i + 1]) / 2, h = (cuts[i + 1] - cuts[i]) / 2;
    sum += (g(c - kNode * h) * 5.0 + g(c) * 8.0 + g(c + kNode * h) * 5.0) * (h / 9);
  }
  return sum;
}

inline double reference_integral(const Volume& v, const Ray& ray, double begin, double end) {
  const BrickGrid& grid = *v.density;
  return integrate_by_cells<double>(
      grid, ray, begin, end,
      [&](double t) { return grid.sample_gradient(grid.world_to_index().point(ray.at(t))).value; },
      0.0);
}

}  // namespace brume::march_cases
