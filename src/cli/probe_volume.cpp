#include "cli/probe_volume.h"

#include "bake/volume_placement.h"
#include "cli/outputs.h"
#include "cli/text_table.h"

namespace brume {
namespace {

RgbGradient of_mode(const VolumeProbe& probe, GradientMode mode) {
  RgbGradient found;
  for (std::size_t m = 0; m < kGradientModes.size(); ++m)
    if (kGradientModes[m] == mode) found = probe.by_mode[m];
  return found;
}

}  // namespace

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
  probe.terms = gatherer.terms(0);
  for (std::size_t m = 0; m < kGradientModes.size(); ++m)
    probe.by_mode[m] = gatherer.gradients(kGradientModes[m])[0];
  probe.radii = volume_record_radii(lighting, request.position);
  if (request.step) {
    options.gradient = GradientMode::None;
    VolumeGatherer values(lighting, effects, options, 0);
    Counters of_differences;  // Not the probe's own cost.
    const auto fluence = [&](std::uint64_t key, const Vec3d& shift) {
      return values.gather(request.position + shift, key, below, of_differences).moments[0];
    };
    probe.difference = finite_difference(fluence, std::nullopt, *request.step, request.seed);
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
  all["mode"] = gradient_mode_name(gather.gradient);
  all["gradient"] = json_of(of_mode(probe, gather.gradient) * per_metre);
  all["gradient_terms"] = {{"radial", json_of(probe.terms.radial * per_metre)},
                           {"walls", json_of(probe.terms.walls * per_metre)},
                           {"grad_sigma", json_of(probe.terms.grad_sigma * per_metre)},
                           {"directional", json_of(probe.terms.directional * per_metre)}};
  Json modes = Json::object();
  for (std::size_t m = 0; m < kGradientModes.size(); ++m)
    modes[gradient_mode_name(kGradientModes[m])] = json_of(probe.by_mode[m] * per_metre);
  all["gradient_modes"] = modes;
  if (probe.difference) {
    all["finite_difference"] = json_of(probe.difference->value * per_metre);
    all["finite_difference_noise"] = json_of(probe.difference->noise * per_metre);
  }
  all["radius"] = json_of(probe.radii);
  all["cells"] = {gather.cells_theta, gather.cells_phi};
  all["rays"] = statistics.counters.rays;
  all["segments"] = statistics.counters.segments;
  all["seconds"] = statistics.total_seconds();
  return all;
}

void add_gradient_rows(std::vector<std::vector<std::string>>& rows, const std::string& name,
                       const RgbGradient& g) {
  const char* const channels[] = {"R", "G", "B"};
  for (int c = 0; c < 3; ++c)
    rows.push_back({c == 0 ? name : "", channels[c], shown_number(g[c].x), shown_number(g[c].y),
                    shown_number(g[c].z)});
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
  std::vector<std::vector<std::string>> rows{{"W/m^3", "", "d/dx", "d/dy", "d/dz"}};
  add_gradient_rows(rows, std::string("gradient, ") + gradient_mode_name(gather.gradient),
                    of_mode(probe, gather.gradient) * per_metre);
  add_gradient_rows(rows, "  radial", probe.terms.radial * per_metre);
  add_gradient_rows(rows, "  walls", probe.terms.walls * per_metre);
  add_gradient_rows(rows, "  grad_sigma", probe.terms.grad_sigma * per_metre);
  add_gradient_rows(rows, "  directional", probe.terms.directional * per_metre);
  if (probe.difference) {
    add_gradient_rows(rows, "finite difference", probe.difference->value * per_metre);
    add_gradient_rows(rows, "  its noise", probe.difference->noise * per_metre);
  }
  for (std::size_t m = 0; m < kGradientModes.size(); ++m)
    if (kGradientModes[m] != gather.gradient && kGradientModes[m] != GradientMode::None)
      add_gradient_rows(rows, std::string("mode ") + gradient_mode_name(kGradientModes[m]),
                        probe.by_mode[m] * per_metre);
  print_table(out, rows);
}

}  // namespace brume
