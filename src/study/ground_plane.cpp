#include "study/ground_plane.h"

#include "core/random.h"

namespace brume {

std::optional<GatherPoint> GroundPlane::at(double x, double z, std::uint64_t key) const {
  const Vec3d up(0, 1, 0);
  const double lift = 1e-4 * scene_.world().diagonal();
  const RayTracer& tracer = scene_.world().tracer();
  const Hit hit = tracer.intersect({{x, area_.min.y + lift, z}, -up}, 2 * lift);
  if (!hit.is_hit() || hit.normal.y < 0.999) return std::nullopt;
  // What stands on the ground is closed, so a ray from inside of it leaves through a back face.
  const Hit above = tracer.intersect({hit.position + up * hit.offset, up});
  if (above.is_hit() && above.normal.y > 0) return std::nullopt;
  return GatherPoint{hit.position, up, hit.offset, key};
}

GroundRecords ground_records(const GroundPlane& ground, const Box3d& area, int along,
                             std::uint64_t key) {
  GroundRecords records;
  const double spacing = area.size().x / along;
  // The corners of a cell are 0.71 of a spacing from its middle, and records wander off theirs.
  records.radius = 1.05 * spacing;
  for (int j = 0; j < along; ++j)
    for (int i = 0; i < along; ++i) {
      const std::uint64_t own = random_key(key, i, j);
      RandomStream random(own);
      constexpr double kWander = 0.3;  // Of a spacing, so that records lie on no line of the scene.
      const double x = ground.x((i + 0.5 + kWander * (random.uniform() - 0.5)) / along);
      const double z = ground.z((j + 0.5 + kWander * (random.uniform() - 0.5)) / along);
      if (const auto point = ground.at(x, z, random_key(own, 1))) records.points.push_back(*point);
    }
  return records;
}

std::array<IrradianceCache, kModeCount> make_ground_caches(
    const GroundRecords& records, const std::vector<PointGather>& gathers) {
  std::array<IrradianceCache, kModeCount> caches;
  for (std::size_t m = 0; m < kModeCount; ++m) {
    std::vector<SurfaceRecord> all;
    for (std::size_t i = 0; i < records.points.size(); ++i) {
      SurfaceRecord r{};
      for (int a = 0; a < 3; ++a) {
        r.position[a] = static_cast<float>(records.points[i].position[a]);
        r.normal[a] = static_cast<float>(records.points[i].normal[a]);
      }
      for (int c = 0; c < 3; ++c) {
        r.irradiance[c] = static_cast<float>(gathers[i].irradiance[c]);
        for (int a = 0; a < 3; ++a)
          r.gradient[3 * c + a] = static_cast<float>(gathers[i].gradient[m][c][a]);
      }
      r.radius[0] = r.radius[1] = static_cast<float>(records.radius);
      r.flags = record_flags(0, 0);
      r.key = i;
      all.push_back(r);
    }
    caches[m] = IrradianceCache(std::move(all), Vec3d(0.0));
  }
  return caches;
}

}  // namespace brume
