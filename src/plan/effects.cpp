#include "plan/effects.h"

namespace brume {

std::vector<std::string> Effects::names() const {
  std::vector<std::string> names;
  const auto add = [&](bool on, const char* name) {
    if (on) names.emplace_back(name);
  };
  add(surfaces, "surfaces");
  add(medium, "medium");
  add(heterogeneous, "heterogeneous");
  add(scattering, "scattering");
  add(multiple_scattering, "multiple_scattering");
  add(anisotropic, "anisotropic");
  add(emission, "emission");
  add(chromatic, "chromatic");
  add(glossy, "glossy");
  add(indirect, "indirect");
  return names;
}

Effects plan_effects(const World& world, int bounces, int volume_bounces) {
  const Medium& medium = world.medium();
  Effects e;
  e.surfaces = !world.tracer().bounds().isEmpty();
  e.medium = !medium.is_vacuum();
  e.heterogeneous = medium.is_heterogeneous();
  e.scattering = volume_bounces > 0 && medium.scatters() && !world.lights().empty();
  e.emission = medium.emits();
  e.chromatic = medium.is_chromatic();
  e.glossy = e.surfaces && world.has_glossy();
  const bool anything_shines = !world.lights().empty() || world.has_gathered_emitters();
  e.indirect = e.surfaces && bounces >= 1 && (anything_shines || e.emission);
  e.multiple_scattering =
      volume_bounces > 1 && medium.scatters() && (anything_shines || e.emission);
  for (const Volume& v : medium.volumes())
    e.anisotropic |=
        (e.scattering || e.multiple_scattering) && v.scatters() && !v.phase.is_isotropic();
  return e;
}

Counters& Counters::operator+=(const Counters& o) {
  rays += o.rays;
  shadow_rays += o.shadow_rays;
  medium_shadow_rays += o.medium_shadow_rays;
  march_rays += o.march_rays;
  segments += o.segments;
  light_volume_lookups += o.light_volume_lookups;
  gathers += o.gathers;
  volume_gathers += o.volume_gathers;
  fallback_gathers += o.fallback_gathers;
  cache_queries += o.cache_queries;
  cache_clamps += o.cache_clamps;
  cache_misses += o.cache_misses;
  return *this;
}

}  // namespace brume
