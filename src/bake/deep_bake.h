// The deep records: one set for all bounces, placed once over all surfaces and gathered once. Top
// records gather what they reflect; no eye sees them.
#pragma once

#include <optional>

#include "bake/bake.h"
#include "bake/light_solve.h"

namespace brume {

struct DeepRecords {
  std::vector<SurfaceRecord> records;  // In RecordOrder.
  int orders = 0;
  double truncation_bound = 0;
  Counters counters;
};

// Whether gathers at these settings see light that has to be solved first: what surfaces reflect more
// than once, or what the medium or emitters send to surfaces that reflect it.
bool needs_deep_records(const World& world, const BakeSettings& settings, const Effects& effects);

// Settings that deep records are gathered and placed with: they are seen only through another gather,
// which averages them.
BakeSettings deep_settings(const BakeSettings& settings);

// Nothing where request.stop_requested() says so first. A pure function of world and settings.
std::optional<DeepRecords> bake_deep_records(const Lighting& lighting, const BakeSettings& settings,
                                             const Effects& effects, const BakeRequest& request,
                                             const Vec3d& origin);

}  // namespace brume
