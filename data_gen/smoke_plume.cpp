#include "data_gen/smoke_plume.h"

#include "core/random.h"
#include "data_gen/noise.h"

namespace brume {

namespace {

// 1 deep inside, 0 on the faces.
double box_fade(const Box3d& box, double width, const Vec3d& p) {
  if (box.isEmpty()) return 1;
  double fade = 1;
  for (int a = 0; a < 3; ++a) {
    fade *= smooth_step(0, width, p[a] - box.min[a]);
    fade *= smooth_step(0, width, box.max[a] - p[a]);
  }
  return fade;
}

}  // namespace

double plume_density(const SmokePlume& plume, const Vec3d& p) {
  const double fade = box_fade(plume.fade_box, plume.fade_width, p);
  if (fade <= 0) return 0;
  // In heights, from the source: the shape is then the same for a candle and for a chimney.
  Vec3d q = (p - plume.source) / plume.height;
  if (q.y <= 0) return 0;

  // Follows the flow back to where the smoke came from. Rising smoke has been stirred for longer,
  // so the way grows with height: the foot of the plume stays smooth, and its top is folded and
  // wispy.
  const CurlNoise large(random_key(plume.seed, 11)), small(random_key(plume.seed, 12));
  constexpr int kSteps = 8;
  const double way = plume.curl * smooth_step(0.02, 0.8, q.y) / kSteps;
  for (int i = 0; i < kSteps; ++i)
    q -= (large.velocity(q * 2.2) * 0.16 + small.velocity(q * 5.3) * 0.07) * way * 2.0;

  const double h = std::clamp(q.y, 0.0, 1.2);
  const double foot = plume.source_radius / plume.height, top = plume.top_radius / plume.height;
  // A widening column that opens into a cap under the ceiling.
  const double radius =
      foot + (top - foot) * std::pow(h, 1.3) + 0.35 * top * smooth_step(0.72, 0.98, h);
  const Vec3d axis(0.06 * std::sin(5.1 * h + 0.4) * h, 0, 0.05 * std::sin(4.3 * h + 2.1) * h);
  const double r = std::hypot(q.x - axis.x, q.z - axis.z) / radius;
  const double column = 1 - smooth_step(0.15, 1.15, r);
  // The same smoke in a wider column is thinner.
  const double thinning = std::pow(foot / radius, 0.55) * (1 - smooth_step(1.0, 1.15, q.y));

  const GradientNoise billows(random_key(plume.seed, 13));
  const double fine = billows.fractal(q * Vec3d(9.0, 6.5, 9.0), 5, 0.58);
  // The noise eats the edges first: where the column is thin, only its crests are left.
  const double eaten =
      column * (1 + 0.9 * plume.detail * fine) - plume.detail * (0.16 - 0.55 * fine);
  return fade * smooth_step(0.02, 0.05, (p.y - plume.source.y) / plume.height) * thinning *
         std::clamp(eaten, 0.0, 1.5);
}

double dust_density(const Dust& dust, const Vec3d& p) {
  const GradientNoise noise(random_key(dust.seed, 21));
  // The fractal noise seldom leaves +-0.5, so this reaches clear air at contrast 1.
  const double clouds = 1 + dust.contrast * 2 * noise.fractal(p / dust.feature_size, 4, 0.55);
  return dust.density * std::exp(-std::max(0.0, p.y - dust.ground) / dust.scale_height) *
         std::max(0.0, clouds);
}

}  // namespace brume
