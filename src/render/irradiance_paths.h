// The truth about a cache's answers: irradiance by traced paths of `cached` transport, which share
// neither records nor gathers with a cache.
#pragma once

#include <cstdint>

#include "bake/bake.h"
#include "cache/answer_check.h"
#include "render/reference_paths.h"

namespace brume {

// One thread's scratch memory; the world must outlive it.
class IrradiancePaths {
 public:
  IrradiancePaths(const World& world, const BakeSettings& settings);
  IrradiancePaths(const IrradiancePaths&) = delete;  // paths_ looks at options_.

  // Goes on to `count` paths (even) from a point, on the side of the unit normal. What they find
  // depends on their key and numbers alone.
  void follow(const Hit& hit, const Vec3d& normal, std::uint64_t key, int count,
              TracedIrradiance& traced);

  std::uint64_t rays() const { return paths_.rays(); }
  std::uint64_t lookups() const { return paths_.lookups(); }

 private:
  PathTracerOptions options_;
  ReferencePaths paths_;
};

}  // namespace brume
