#include "vdb_media/depth_marcher.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cone_kernel.h"

namespace brume {

static_assert(DepthMarcher::kRays == kConeLanes);

struct DepthMarcher::State {
  const BrickGrid* grid = nullptr;
  Box3d box;     // Where the level's field is, in the grid's index space.
  Vec3d corner;  // Of the grid's first brick.
  ConeTrack track;
};

DepthMarcher::DepthMarcher(const Volume& volume, const BrickPyramid& pyramid, double step,
                           double voxels) {
  auto state = std::make_unique<State>();
  state->grid = volume.density.get();
  state->corner = Vec3d(state->grid->brick_min()) * double(BrickGrid::kCells);
  const int level = cone_level_for(pyramid, voxels);
  ConeTrack& track = state->track;
  for (int l = 0; l <= level; ++l) track.levels.push_back(cone_level(pyramid, l));
  if (!pyramid.level(level).is_empty()) {
    const double scale = static_cast<double>(1 << level);
    const Box3d& box = pyramid.level(level).index_bounds();
    state->box = Box3d(box.min * scale, box.max * scale);
    // Steps are counted from where a ray enters, so the longest way through decides.
    const double longest = state->grid->index_to_world().box(state->box).size().length();
    const int count = static_cast<int>(std::ceil(longest / step)) + 1;
    for (int k = 0; k < count; ++k)
      track.steps.push_back(
          {static_cast<float>(k * step), static_cast<float>((k + 1) * step), level, 0});
  }
  track.shell_ends = {static_cast<std::int32_t>(track.steps.size())};
  track.shifts = {0};
  track.enough = std::numeric_limits<float>::infinity();
  track.samples = false;
  state_ = std::move(state);
}
DepthMarcher::~DepthMarcher() = default;
DepthMarcher::DepthMarcher(DepthMarcher&&) noexcept = default;

void DepthMarcher::march(std::span<const Ray> rays, std::span<const double> ends,
                         std::span<float> integrals) const {
  const State& s = *state_;
  const Affine3d& to_index = s.grid->world_to_index();
  ConePacket packet{};
  packet.place.fill(0.5f);
  for (std::size_t i = 0; i < rays.size() && !s.box.isEmpty(); ++i) {
    const Vec3d direction = to_index.vector(rays[i].direction);
    const Vec3d origin = to_index.point(rays[i].origin);
    const Interval met = clip({origin, direction}, s.box, {0, ends[i]});
    if (met.is_empty()) continue;
    packet.end[i] = static_cast<float>(met.end - met.begin);
    for (int a = 0; a < 3; ++a) {
      const auto axis = static_cast<std::size_t>(a);
      packet.origin[axis][i] =
          static_cast<float>(origin[a] + direction[a] * met.begin - s.corner[a]);
      packet.direction[axis][i] = static_cast<float>(direction[a]);
    }
  }
  ConeLane found, unused;
  march_cones(s.track, packet, {found.data(), unused.data(), {}, {}});
  std::copy_n(found.begin(), integrals.size(), integrals.begin());
}

}  // namespace brume
