// render --pixel: everything that went into one pixel.
#pragma once

#include "bake/bake.h"
#include "cli/command.h"
#include "cli/statistics.h"
#include "cli/values.h"
#include "render/film.h"
#include "scene/camera_rays.h"

namespace brume {

struct PixelStory {
  Size2 pixel, size;
  int samples = 0;
  const PixelResult& result;
  const World& world;
  const CameraRays& rays;
  // With records: who answers at what the pixel's centre sees. Null with path tracing.
  const IrradianceCache* cache = nullptr;
  const BakeSettings* settings = nullptr;
};

// As a table, or with --json as one object.
void explain_pixel(const CommandContext& context, const PixelStory& story);

}  // namespace brume
