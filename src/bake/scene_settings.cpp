#include "bake/scene_settings.h"

namespace brume {

BakeSettings settings_of(const RenderSettings& render) {
  BakeSettings settings;
  settings.gather.cells_theta = render.cells_theta;
  settings.gather.cells_phi = render.cells_phi;
  settings.gather.shells = render.shells;
  settings.gather.footprint = render.footprint;
  settings.gather.lamp_samples = render.lamp_samples;
  settings.gather.step_voxels = render.step_voxels;
  settings.bounces = render.bounces;
  settings.volume_bounces = render.volume_bounces.value_or(kEveryOrder);
  settings.seed = render.seed;
  return settings;
}

}  // namespace brume
