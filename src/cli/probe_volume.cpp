#include "cli/probe_volume.h"

#include "bake/volume_placement.h"
#include "cli/outputs.h"
#include "cli/text_table.h"

namespace brume {
VolumeProbe probe_volume(const Lighting& lighting, const BakeSettings& settings,
                         const IrradianceCache& deeper, const VolumeProbeRequest& request,
                         Counters& counters) {
  const World& world = lighting.world();
  const Effects effects = plan_effects(world, settings.bounces, settings.volume_bounces);
  const HitLight below = light_below(deeper, settings, world, 0);
  VolumeProbe probe;
  probe.position = request.position;
  GatherOptions options = request.gather;
  options.gradient = GradientMode::Full;  // Gathers what every other mode needs.
  VolumeGatherer gatherer(lighting, effects, options, 0);
  const VolumeGatherResult g =
      gatherer.gather(request.position, probe_key(request.seed, 0), below, counters);
  probe.fluence = g.moments[0];
  probe.surface = g.fluence_surface;
  probe.media = g.fluence_media;
  probe.error = g.error;
  for (std::size_t m = 0; m < kGradientModes.size(); ++m)
    probe.gradients.by_mode[m] = gatherer.gradients(kGradientModes[m])[0];
  probe.radii = volume_record_radii(lighting, request.position);
  if (request.step) {
    options.gradient = GradientMode::None;
    VolumeGatherer values(lighting, effects, options, 0);
    Counters of_differences;  // Not the probe's own cost.
    const auto fluence = [&](std::uint64_t key, const Vec3d& shift) {
      return values.gather(request.position + shift, key, below, of_differences).moments[0];
    };
    probe.gradients.difference =
        finite_difference(fluence, std::nullopt, *request.step, request.seed);
  }
  return probe;
}

Json volume_probe_json(const VolumeProbe& probe, const GatherOptions& gather, double per_metre,
                       const Statistics& statistics) {
  Json all = Json::object();
  all["position"] = json_of(probe.position);
  all["fluence"] = json_of(probe.fluence);
  all["fluence_surface"] = json_of(probe.surface);
  all["fluence_media"] = json_of(probe.media);
  all["fluence_error"] = probe.error;
  add_gradients(all, probe.gradients, gather.gradient, per_metre);
  all["radius"] = json_of(probe.radii);
  all["cells"] = {gather.cells_theta, gather.cells_phi};
  all["rays"] = statistics.counters.rays;
  all["segments"] = statistics.counters.segments;
  all["seconds"] = statistics.total_seconds();
  return all;
}

void print_volume_probe(std::ostream& out, const VolumeProbe& probe, const GatherOptions& gather,
                        double per_metre) {
  const auto colour = [](const char* name, const RgbD& c) {
    return std::vector<std::string>{name, shown_number(c.r), shown_number(c.g), shown_number(c.b)};
  };
  print_table(out, {{"W/m^2", "R", "G", "B"},
                    colour("fluence (indirect)", probe.fluence),
                    colour("  from surfaces", probe.surface),
                    colour("  from the medium", probe.media)});
  out << "standard error of luminance " << shown_number(probe.error) << "; radii "
      << shown_number(probe.radii.x) << ' ' << shown_number(probe.radii.y) << ' '
      << shown_number(probe.radii.z) << "; " << gather.cells_theta << 'x' << gather.cells_phi
      << " cells\n\n";
  print_table(out, gradient_rows(probe.gradients, gather.gradient, per_metre));
}

}  // namespace brume
