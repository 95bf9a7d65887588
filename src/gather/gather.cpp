#include "gather/gather.h"

#include "core/error.h"
#include "gather/cell_gather.h"

namespace brume {

const char* gradient_mode_name(GradientMode mode) {
  switch (mode) {
    case GradientMode::None:
      return "none";
    case GradientMode::WardHeckbert:
      return "ward-heckbert";
    case GradientMode::Media:
      return "media";
    case GradientMode::Full:
      return "full";
  }
  return "none";
}

GradientMode parse_gradient_mode(const std::string& name) {
  for (const GradientMode m : kGradientModes)
    if (name == gradient_mode_name(m)) return m;
  throw Error(ErrorKind::Usage, "--gradient: '" + printable(name) +
                                    "' is not a mode: use none, ward-heckbert, media or full");
}

IrradianceQuery hit_query(const World& world, int layer, const Vec3d& position, const Vec3d& normal,
                          double footprint) {
  constexpr int kMostStretches = 40;  // From any corner to the nearest in sight.
  return {layer, position, normal, footprint, &world.tracer(), kMostStretches, true};
}

struct Gatherer::Impl {
  Impl(const Lighting& lighting, const Effects& effects, const GatherOptions& options)
      : mode(options.gradient), around(lighting, effects, options, DirectionDomain::Hemisphere) {}

  GatherResult gather(const GatherPoint& point, const HitLight& light, Counters& counters);
  GradientTerms full_terms(Counters& counters);
  GradientTerms terms_of(GradientMode mode, Counters& counters);
  RgbGradient wall_term() const;

  GradientMode mode;
  CellGather around;
  GradientTerms kept;  // Of mode Full.
};

// T2: sum over walls of B (Phi_hi - Phi_lo).
RgbGradient Gatherer::Impl::wall_term() const {
  RgbGradient sum;
  for (const CellWall& wall : around.cells().walls())
    sum += outer(around.across(wall), around.frame().to_world(wall.moment));
  return sum;
}

GatherResult Gatherer::Impl::gather(const GatherPoint& point, const HitLight& light,
                                    Counters& counters) {
  ++counters.gathers;
  around.gather(point.position + point.normal * point.offset, Frame(point.normal), point.key, light,
                counters);
  const DirectionCells& cells = around.cells();
  GatherResult result;
  result.shells = around.shell_count();
  double inverse_distance = 0, light_over_distance = 0;
  for (int c = 0; c < cells.count(); ++c) {
    const CellLight& seen = around.light(c);
    const double g = cells.cell(c).measure;
    result.irradiance_media += seen.media * g;
    result.irradiance_surface += seen.surface * g;
    result.irradiance_emitted += seen.emitted * g;
    result.nearest = std::min(result.nearest, around.hit_distance(c));
    light_over_distance += g * seen.over_distance;
    result.rotational += outer(seen.total(), around.frame().to_world(cells.cell(c).rotation));
    if (around.hit_distance(c) < kInfinity) inverse_distance += g / around.hit_distance(c);
  }
  result.irradiance = result.irradiance_surface + result.irradiance_media;
  if (mode == GradientMode::Full) kept = full_terms(counters);
  result.terms = terms_of(mode, counters);
  result.error = around.error();
  result.mean_distance = inverse_distance > 0 ? kPi / inverse_distance : kInfinity;
  result.light_distance =
      light_over_distance > 0 ? luminance(result.irradiance) / light_over_distance : kInfinity;
  return result;
}

GradientTerms Gatherer::Impl::full_terms(Counters& counters) {
  const DirectionCells& cells = around.cells();
  GradientTerms terms;
  terms.walls = wall_term();
  for (int c = 0; c < cells.count(); ++c) {
    const CellLight& seen = around.light(c);
    terms.grad_sigma += seen.grad_sigma * cells.cell(c).measure;
    terms.directional += seen.directional * cells.cell(c).measure;
  }
  // T1: sum of W (sigma L - Q), the transfer equation itself (gradients.md 2).
  if (!around.has_radial_term()) return terms;
  around.look_here(counters);
  for (int c = 0; c < cells.count(); ++c)
    terms.radial += outer(around.radial(c), around.frame().to_world(cells.cell(c).direction));
  return terms;
}

GradientTerms Gatherer::Impl::terms_of(GradientMode of, Counters& counters) {
  GradientTerms terms;
  switch (of) {
    case GradientMode::None:
      break;
    case GradientMode::Full:
      terms = kept;
      break;
    case GradientMode::Media:
      // All of it is the medium's change along the ray.
      if (!around.has_moving_medium()) break;
      around.start_over();
      for (int c = 0; c < around.cells().count(); ++c)
        terms.grad_sigma += around.moving_medium(c, counters) * around.cells().cell(c).measure;
      break;
    case GradientMode::WardHeckbert:
      around.use_surface_distances();
      terms.walls = wall_term();
  }
  return terms;
}

const Strata& Gatherer::strata() const { return impl_->around.strata(); }

Gatherer::Gatherer(const Lighting& lighting, const Effects& effects, const GatherOptions& options)
    : impl_(std::make_unique<Impl>(lighting, effects, options)) {}
Gatherer::~Gatherer() = default;

GatherResult Gatherer::gather(const GatherPoint& point, const HitLight& light, Counters& counters) {
  return impl_->gather(point, light, counters);
}

GradientTerms Gatherer::gradient(GradientMode mode) {
  Counters counters;
  return impl_->terms_of(mode, counters);
}

}  // namespace brume
