// brume probe --volume: fluence at a point of the medium and its gradients.
#pragma once

#include <array>
#include <optional>

#include "bake/bake.h"
#include "cli/finite_difference.h"
#include "cli/statistics.h"
#include "gather/volume_gather.h"

namespace brume {

struct VolumeProbe {
  Vec3d position{0.0};
  RgbD fluence, surface, media;  // Of all but light straight from lights, and what it is made of.
  double error = 0;              // Estimated standard error of the fluence's luminance.
  std::array<RgbGradient, kGradientModes.size()> by_mode;  // Per world unit.
  GradientTerms terms;                                     // Of mode Full.
  Vec3d radii{0.0};                                        // World units.
  std::optional<FiniteDifference> difference;
};

struct VolumeProbeRequest {
  Vec3d position{0.0};
  GatherOptions gather;
  std::uint64_t seed = 1;
  std::optional<double> step;  // Of finite differences.
};

VolumeProbe probe_volume(const Lighting& lighting, const BakeSettings& settings,
                         const IrradianceCache& deeper, const VolumeProbeRequest& request,
                         Counters& counters);

Json volume_probe_json(const VolumeProbe& probe, const GatherOptions& gather, double per_metre,
                       const Statistics& statistics);
void print_volume_probe(std::ostream& out, const VolumeProbe& probe, const GatherOptions& gather,
                        double per_metre);

// Rows of a table: one for each channel, the first with the name.
void add_gradient_rows(std::vector<std::vector<std::string>>& rows, const std::string& name,
                       const RgbGradient& g);

}  // namespace brume
