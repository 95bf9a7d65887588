// Which effects a scene needs, decided once and before any ray is traced (DESIGN 4.11).
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "scene/scene.h"
#include "scene/world.h"

namespace brume {

struct Effects {
  bool surfaces = false;       // Any geometry.
  bool medium = false;         // Anything to march: else march counters stay 0.
  bool heterogeneous = false;  // Any grid.
  bool scattering = false;     // Light scatters in the medium: else no light visibility is traced there.
  bool multiple_scattering = false;  // More than once, or after surfaces: else no volume records.
  bool anisotropic = false;    // Some scattering volume has g != 0: the directional gradient term.
  bool emission = false;       // The medium glows.
  bool chromatic = false;      // Extinction differs between channels.
  bool glossy = false;         // Glossy lobes to sample.
  bool indirect = false;       // Anything for records to hold: bounces >= 1 and something that sends light.

  // Names of those that run, for JSON.
  std::vector<std::string> names() const;
};

// volume_bounces `auto`: as many as matter.
inline constexpr int kEveryOrder = std::numeric_limits<int>::max();

// Of a world at these settings; volume_bounces 0 switches scattering off, 1 leaves single scattering.
Effects plan_effects(const World& world, int bounces, int volume_bounces);

// What was done, by stage; merged from threads at the end.
struct Counters {
  std::uint64_t rays = 0;           // Eye and gather rays.
  std::uint64_t shadow_rays = 0;    // From surfaces.
  std::uint64_t medium_shadow_rays = 0;  // From points in the medium.
  std::uint64_t march_rays = 0, segments = 0;
  std::uint64_t light_volume_lookups = 0;
  std::uint64_t gathers = 0;            // Records computed, of surfaces
  std::uint64_t volume_gathers = 0;     // and of the medium.
  std::uint64_t fallback_gathers = 0;   // Computed while rendering, where no record answered.
  std::uint64_t cache_queries = 0, cache_clamps = 0, cache_misses = 0;

  Counters& operator+=(const Counters& o);
};

}  // namespace brume
