// brume probe --volume: fluence at a point of the medium and its gradients.
#pragma once

#include <optional>

#include "bake/bake.h"
#include "cli/probed_gradients.h"
#include "gather/volume_gather.h"

namespace brume {

struct VolumeProbe {
  Vec3d position{0.0};
  RgbD fluence, surface, media;  // Of all but light straight from lights, and what it is made of.
  double error = 0;              // Estimated standard error of the fluence's luminance.
  ProbedGradients gradients;
  Vec3d radii{0.0};              // World units.
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

}  // namespace brume
