// The deep records, of surfaces and of the medium: one set for all orders, placed once and gathered
// once. Top records gather what they reflect and scatter; eye rays see those of the medium.
#pragma once

#include <optional>

#include "bake/bake.h"
#include "bake/light_solve.h"

namespace brume {

struct DeepRecords {
  std::vector<SurfaceRecord> surface;  // In RecordOrder.
  std::shared_ptr<const VolumeCache> volume;
  std::shared_ptr<const IncidentField> scattered;  // Of `volume`; null where no gather asked.
  DeepStats stats;
  Counters counters;
};

// Whether gathers at these settings see light that has to be solved first: what surfaces reflect
// more than once, or what the medium or emitters send to surfaces that reflect it. Records of the
// medium are needed where Effects::multiple_scattering says so.
bool needs_deep_surfaces(const World& world, const BakeSettings& settings, const Effects& effects);

// Settings that deep records are gathered and placed with: they are seen only through another
// gather, which averages them.
BakeSettings deep_settings(const BakeSettings& settings);

// Nothing where request.stop_requested() says so first. A pure function of world and settings.
std::optional<DeepRecords> bake_deep_records(const Lighting& lighting, const BakeSettings& settings,
                                             const Effects& effects, const BakeRequest& request,
                                             const Vec3d& origin);

}  // namespace brume
