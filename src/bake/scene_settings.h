// What a scene file asks of a bake.
#pragma once

#include "bake/bake.h"
#include "scene/scene.h"

namespace brume {

// The rest by default; volume_bounces `auto` is kEveryOrder.
BakeSettings settings_of(const RenderSettings& render);

}  // namespace brume
