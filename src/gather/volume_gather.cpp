#include "gather/volume_gather.h"

#include "core/sampling.h"
#include "gather/cell_gather.h"

namespace brume {

struct VolumeGatherer::Impl {
  Impl(const Lighting& l, const Effects& effects, const GatherOptions& options, int o)
      : mode(options.gradient),
        order(o),
        around(l, effects, options, DirectionDomain::Sphere) {}

  VolumeGatherResult gather(const Vec3d& position, std::uint64_t key, const HitLight& light,
                            Counters& counters);
  void add_full_terms(Counters& counters);
  void add_walls(std::vector<GradientTerms>& to) const;
  std::vector<GradientTerms> gradients(GradientMode of, Counters& counters);

  std::size_t count() const { return harmonic_count(order); }
  // Of the middle of a cell, where what is not a sample's is weighted.
  Harmonics at_middle(int c) const {
    return harmonics(around.frame().to_world(around.cells().cell(c).direction).normalized());
  }
  Harmonics harmonics(const Vec3d& w) const {
    Harmonics y;
    evaluate_harmonics(order, w, y);
    return y;
  }

  GradientMode mode;
  int order;
  CellGather around;
  std::vector<GradientTerms> kept;  // Of mode Full, by moment.
};

VolumeGatherResult VolumeGatherer::Impl::gather(const Vec3d& position, std::uint64_t key,
                                                const HitLight& light, Counters& counters) {
  ++counters.volume_gathers;
  // Rings of cells about an axis at random.
  RandomStream random(random_key(key, 0x7370686572ULL));
  around.gather(position, Frame(sample_sphere(random.uniform2())), key, light, counters);

  const DirectionCells& cells = around.cells();
  VolumeGatherResult result;
  result.moments.assign(count(), RgbD());
  result.reflected.assign(count(), RgbD());
  for (int c = 0; c < cells.count(); ++c) {
    const CellLight& seen = around.light(c);
    const RgbD total = seen.total();
    const double g = cells.cell(c).measure;
    const Harmonics y = harmonics(around.direction(c));
    const RgbD reflected = seen.surface - seen.emitted;
    for (std::size_t k = 0; k < count(); ++k) {
      result.moments[k] += total * (g * y[k]);
      result.reflected[k] += reflected * (g * y[k]);
    }
    result.fluence_surface += seen.surface * g;
    result.fluence_media += seen.media * g;
    result.nearest = std::min(result.nearest, around.hit_distance(c));
  }
  result.error = around.error();
  if (mode == GradientMode::Full) add_full_terms(counters);
  return result;
}

void VolumeGatherer::Impl::add_walls(std::vector<GradientTerms>& to) const {
  for (const CellWall& wall : around.cells().walls()) {
    const RgbD across = around.across(wall);
    if (is_black(across)) continue;
    const Harmonics y = harmonics(around.frame().to_world(wall.middle));
    const RgbGradient g = outer(across, around.frame().to_world(wall.moment));
    for (std::size_t k = 0; k < count(); ++k) to[k].walls += g * y[k];
  }
}

void VolumeGatherer::Impl::add_full_terms(Counters& counters) {
  const DirectionCells& cells = around.cells();
  kept.assign(count(), GradientTerms());
  add_walls(kept);
  if (around.has_radial_term()) around.look_here(counters);
  for (int c = 0; c < cells.count(); ++c) {
    const CellLight& seen = around.light(c);
    const Harmonics y = at_middle(c);
    const double g = cells.cell(c).measure;
    const RgbGradient radial =
        around.has_radial_term()
            ? outer(around.radial(c), around.frame().to_world(cells.cell(c).direction))
            : RgbGradient();
    for (std::size_t k = 0; k < count(); ++k) {
      kept[k].radial += radial * y[k];
      kept[k].grad_sigma += seen.grad_sigma * (g * y[k]);
      kept[k].directional += seen.directional * (g * y[k]);
    }
  }
}

std::vector<GradientTerms> VolumeGatherer::Impl::gradients(GradientMode of, Counters& counters) {
  std::vector<GradientTerms> terms(count());
  switch (of) {
    case GradientMode::None:
      break;
    case GradientMode::Full:
      return kept;
    case GradientMode::Media:
      // All of it is the medium's change along the ray.
      if (!around.has_moving_medium()) break;
      around.start_over();
      for (int c = 0; c < around.cells().count(); ++c) {
        const RgbGradient moved = around.moving_medium(c, counters);
        const Harmonics y = at_middle(c);
        for (std::size_t k = 0; k < count(); ++k)
          terms[k].grad_sigma += moved * (around.cells().cell(c).measure * y[k]);
      }
      break;
    case GradientMode::WardHeckbert:
      around.use_surface_distances();
      add_walls(terms);
  }
  return terms;
}

VolumeGatherer::VolumeGatherer(const Lighting& lighting, const Effects& effects,
                               const GatherOptions& options, int order)
    : impl_(std::make_unique<Impl>(lighting, effects, options, order)) {}
VolumeGatherer::~VolumeGatherer() = default;

VolumeGatherResult VolumeGatherer::gather(const Vec3d& position, std::uint64_t key,
                                          const HitLight& light, Counters& counters) {
  return impl_->gather(position, key, light, counters);
}

std::vector<GradientTerms> VolumeGatherer::gradients(GradientMode mode) {
  Counters counters;
  return impl_->gradients(mode, counters);
}

const Strata& VolumeGatherer::strata() const { return impl_->around.strata(); }

}  // namespace brume
