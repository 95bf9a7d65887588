#include <cmath>
#include <cstdio>

#include "bake/bake.h"

namespace brume {
namespace {

// Bumped whenever the same scene and settings would give other records.
constexpr int kAlgorithmVersion = 17;

// Infinity is null.
std::string number(double v) {
  if (!std::isfinite(v)) return "null";
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", v);
  return text;
}

}  // namespace

std::string BakeSettings::to_json() const {
  return "{\"algorithm\":" + std::to_string(kAlgorithmVersion) + ",\"cells\":[" +
         std::to_string(gather.cells_theta) + "," + std::to_string(gather.cells_phi) +
         "],\"shells\":" + std::to_string(gather.shells) +
         ",\"footprint\":" + number(gather.footprint) +
         ",\"lamp_samples\":" + std::to_string(gather.lamp_samples) +
         ",\"step_voxels\":" + number(gather.step_voxels) + ",\"gradient\":\"" +
         gradient_mode_name(gather.gradient) + "\",\"bounces\":" + std::to_string(bounces) +
         ",\"volume_bounces\":" +
         (volume_bounces == kEveryOrder ? "\"auto\"" : std::to_string(volume_bounces)) +
         ",\"seed\":" + std::to_string(seed) + ",\"error\":" + number(error) +
         ",\"min_radius_m\":" + number(min_radius) + ",\"max_radius_m\":" + number(max_radius) +
         ",\"light_depth\":\"" + (light_depth == LightDepth::Exact ? "exact" : "volumes") + "\"}";
}

Fingerprint bake_fingerprint(const World& world, const BakeSettings& settings) {
  // The JSON holds every setting, exactly.
  return FingerprintBuilder().add(world.fingerprint()).add(settings.to_json()).finish();
}

std::uint64_t request_hash(const BakeRequest& request) {
  FingerprintBuilder all;
  all.add(request.everywhere);
  for (const BakeView& view : request.views) {
    const Camera& c = view.camera;
    for (const Vec3d& v : {c.position, c.look_at, c.up})
      for (int a = 0; a < 3; ++a) all.add(v[a]);
    all.add(c.fov_deg).add(view.width).add(view.height);
  }
  return all.finish().words[0];
}

}  // namespace brume
