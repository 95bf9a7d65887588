#include "vdb_media/ray_marcher.h"

#include "march.h"

namespace brume {
namespace {

// Spans are integrated this many at a time: their segments still fit the first-level cache.
constexpr int kSpansAtOnce = 12;

double grid_integral(const BrickGrid& grid, const Ray& ray, Interval t, const MarchOptions& options,
                     MarchCounters& counters) {
  const auto entry = enter(grid, ray, t);
  if (!entry) return 0;
  ++counters.rays;
  const Field field = make_field(grid, entry->ray, options);
  thread_local Segments segments(kSpansAtOnce);
  std::array<Span, kSpansAtOnce> spans;
  int count = 0;
  double sum = 0;
  const auto flush = [&] {
    collect(field, spans.data(), count, nullptr, segments);
    counters.segments += segments.count;
    sum += integrate(field, segments);
    count = 0;
  };
  walk_bricks(grid, *entry, [&](std::int32_t top, const Vec3i& corner, double begin, double end) {
    if (top < 0) {
      sum += double(grid.tile(top)) * (end - begin);
      ++counters.segments;
      return;
    }
    spans[count++] = make_span(grid, top, corner, begin, end);
    if (count == kSpansAtOnce) flush();
  });
  if (count > 0) flush();
  return sum;
}

}  // namespace

double density_integral(const Volume& volume, const Ray& ray, Interval t,
                        const MarchOptions& options, MarchCounters& counters) {
  if (!volume.is_homogeneous()) return grid_integral(*volume.density, ray, t, options, counters);
  const Interval inside = clip_homogeneous(volume, ray, t);
  if (inside.is_empty()) return 0;
  ++counters.rays;
  ++counters.segments;
  return inside.end - inside.begin;
}

RgbD optical_depth(const Medium& medium, const Ray& ray, Interval t, const MarchOptions& options,
                   MarchCounters& counters) {
  RgbD tau;
  for (const Volume& v : medium.volumes())
    add_depth(tau, v.sigma_t(), density_integral(v, ray, t, options, counters));
  return tau;
}

}  // namespace brume
