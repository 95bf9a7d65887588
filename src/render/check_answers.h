// Whether a cache's answers are true: at a few points of what asks, as a picture asks, against
// paths that share no code and no records with it.
#pragma once

#include <cstdint>
#include <vector>

#include "bake/bake.h"
#include "cache/answer_check.h"

namespace brume {

// Where irradiance is asked for.
struct AskedPoint {
  Hit hit;
  Vec3d normal{0.0};  // On the side that receives.
  double footprint = 0;
};

// `count` points of what the request asks for, spread evenly: over its views' pixels, or over all
// surfaces by area, either side. Fewer where views see fewer surfaces that reflect.
std::vector<AskedPoint> asked_points(const World& world, const BakeRequest& request, int count,
                                     std::uint64_t seed);

inline constexpr int kCheckedPoints = 64;

// Who answers at `count` points of the request, and the truth; of a shard, the truth at its part of
// them. A pure function of its arguments, and for all shards united that of the whole. Takes 2 CPU
// seconds, or a twentieth of what gathering for the request takes where that is less (a tenth of a
// second at least), besides gathers where no record answers. Truths that are `known`, of the same
// request and as many points, are taken over and cost nothing.
CheckedRequest check_answers(const Lighting& lighting, const BakeSettings& settings,
                             const IrradianceCache& cache, const BakeRequest& request, int count,
                             const Scattered& scattered = nullptr,
                             const CheckedRequest* known = nullptr);

}  // namespace brume
