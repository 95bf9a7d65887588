// What an image says about itself (SPEC, "Images").
#pragma once

#include <string>
#include <vector>

#include "cli/statistics.h"
#include "core/hash.h"
#include "core/image.h"
#include "cache/answer_check.h"
#include "scene/camera_rays.h"
#include "scene/scene.h"

namespace brume {

struct RenderProvenance {
  const std::vector<std::string>& arguments;
  const Scene& scene;
  const CameraRays& rays;
  const Statistics& statistics;
  Fingerprint scene_fingerprint;
  std::optional<Fingerprint> cache_fingerprint;  // None with path tracing.
  const std::optional<AnswerCheck>& check;
  std::size_t bad_pixels = 0;
  int samples = 0;
  bool is_reproducible = false;  // Nothing that two equal runs would differ in.
};

ImageMetadata render_metadata(const RenderProvenance& provenance);

}  // namespace brume
