// What a picture takes for the irradiance at a point that it sees: the answer of records, else of a
// gather there and then.
#pragma once

#include <cstdint>
#include <memory>

#include "bake/bake.h"
#include "gather/gather.h"

namespace brume {

// Scratch memory of one thread. What it is given must outlive it.
class PictureIrradiance {
 public:
  PictureIrradiance(const Lighting& lighting, const Effects& effects, const BakeSettings& settings,
                    const IrradianceCache& cache, const HitLight& below)
      : lighting_(lighting), effects_(effects), settings_(settings), cache_(cache), below_(below) {}

  // `footprint`: as pixel_query() takes it. Black without records where `may_gather` is false. A
  // gather's random numbers derive from `key`.
  InterpolatedIrradiance answer(const Hit& hit, const Vec3d& normal, double footprint,
                                bool may_gather, std::uint64_t key, Counters& counters);
  RgbD gather(const Hit& hit, const Vec3d& normal, std::uint64_t key, Counters& counters);

 private:
  const Lighting& lighting_;
  const Effects& effects_;
  const BakeSettings& settings_;
  const IrradianceCache& cache_;
  const HitLight& below_;
  std::unique_ptr<Gatherer> gatherer_;
};

}  // namespace brume
