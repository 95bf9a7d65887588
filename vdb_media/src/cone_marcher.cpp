#include "vdb_media/cone_marcher.h"

#include <algorithm>

#include "cone_kernel.h"
#include "march.h"
#include "vdb_media/brick_pyramid.h"

namespace brume {
namespace {

// A step that may be this thick is cut, but not below a voxel: what one sample says of it goes into
// an exponential.
constexpr double kMostDepth = 1.5;
// Voxels are this much finer than steps: coarser ones blur what a ray of its own would see.
constexpr double kVoxelsPerStep = 4;
// What lies behind so many mean free paths does not arrive.
constexpr double kEndOfSight = 40;

static_assert(ConeMarcher::kRays == kConeLanes);

double least_component(const RgbD& c) { return std::min(c.r, std::min(c.g, c.b)); }

double step_length(const Volume& volume, const BrickPyramid& pyramid, double least, double wanted) {
  const double sigma_t = max_component(volume.sigma_t());
  while (wanted > least &&
         sigma_t * pyramid.level(pyramid.level_for(wanted)).range().max * wanted > kMostDepth)
    wanted *= 0.5;
  return std::max(wanted, least);
}

}  // namespace

struct ConeMarcher::State {
  struct Track : ConeTrack {
    Box3d box;  // Around all levels that are used, in the finest one's index space.
  };
  std::vector<Track> tracks;  // By volume.
  // Of the rays at hand: by volume or channel, shell, and ray.
  std::vector<float> integral, sample, depths, transmittance, end;
  std::array<std::vector<float>, 3> gradient, moment;
  std::array<int, kRays> shell_counts{};
  bool has_gradients = false;
  int rows = 0, channels = 1;
  std::size_t row_floats() const { return static_cast<std::size_t>(rows) * kConeLanes; }
};

ConeMarcher::ConeMarcher(const Medium& medium, double step_voxels)
    : medium_(&medium), step_voxels_(step_voxels), state_(std::make_unique<State>()) {}
ConeMarcher::~ConeMarcher() = default;
ConeMarcher::ConeMarcher(ConeMarcher&&) noexcept = default;

void ConeMarcher::begin(const Vec3d& origin, std::span<const double> boundaries, double width,
                        std::span<const float> shifts) {
  origin_ = origin;
  boundaries_.assign(boundaries.begin(), boundaries.end());
  State& s = *state_;
  s.rows = static_cast<int>(boundaries_.size());
  s.channels = medium_->is_chromatic() ? 3 : 1;
  s.tracks.resize(medium_->volumes().size());
  for (std::size_t v = 0; v < s.tracks.size(); ++v) add_track(static_cast<int>(v), width, shifts);
}

void ConeMarcher::add_track(int volume, double width, std::span<const float> shifts) {
  const Volume& v = medium_->volumes()[static_cast<std::size_t>(volume)];
  State::Track& track = state_->tracks[static_cast<std::size_t>(volume)];
  track.steps.clear();
  track.levels.clear();
  track.shell_ends.clear();
  track.shifts.assign(shifts.begin(), shifts.end());
  track.mean_sigma_t = static_cast<float>(mean_component(v.sigma_t()));
  track.enough = static_cast<float>(kEndOfSight / least_component(v.sigma_t()));
  const BrickPyramid* pyramid = v.is_homogeneous() ? nullptr : &medium_->pyramid(volume);
  const double least = pyramid ? v.density->voxel_size() * std::max(1.0, step_voxels_) : 0;
  int coarsest = 0;
  for (std::size_t s = 0; s + 1 < boundaries_.size(); ++s) {
    const double begin = boundaries_[s], end = boundaries_[s + 1];
    int count = 1, level = 0;
    if (pyramid) {
      const double wanted = step_length(v, *pyramid, least, width * 0.5 * (begin + end));
      count = std::max(1, static_cast<int>(std::lround((end - begin) / wanted)));
      level = cone_level_for(*pyramid, wanted / kVoxelsPerStep);
      coarsest = std::max(coarsest, level);
    }
    for (int i = 0; i < count; ++i) {
      const auto edge = [&](int k) {
        return static_cast<float>(k < count ? begin + (end - begin) * k / count : end);
      };
      // Steps of a shell a golden section apart.
      const double shift = shifts[s] + i * (std::numbers::phi - 1);
      track.steps.push_back(
          {edge(i), edge(i + 1), level, static_cast<float>(shift - std::floor(shift))});
    }
    track.shell_ends.push_back(static_cast<std::int32_t>(track.steps.size()));
  }
  track.box = Box3d();
  for (int l = 0; pyramid && l <= coarsest; ++l) {
    const BrickGrid& grid = pyramid->level(l);
    track.levels.push_back(cone_level(*pyramid, l));
    if (grid.is_empty()) continue;
    const double scale = static_cast<double>(1 << l);
    track.box.extendBy(Box3d(grid.index_bounds().min * scale, grid.index_bounds().max * scale));
  }
}

void ConeMarcher::march_volume(int volume, std::span<const ConeRay> rays, bool want_gradients,
                               MarchCounters& counters) {
  const auto v = static_cast<std::size_t>(volume);
  const Volume& in = medium_->volumes()[v];
  State& s = *state_;
  const State::Track& track = s.tracks[v];
  const Interval all{boundaries_.front(), boundaries_.back()};
  const Vec3d origin = in.is_homogeneous() ? origin_ : in.density->world_to_index().point(origin_);
  const Vec3d corner =
      in.is_homogeneous() ? Vec3d(0.0) : Vec3d(in.density->brick_min()) * double(BrickGrid::kCells);
  ConePacket packet{};
  for (std::size_t r = 0; r < rays.size(); ++r) {
    const ConeRay& ray = rays[r];
    const Interval reach{all.begin, std::min(all.end, ray.end)};
    Interval met{0, 0};
    if (in.is_homogeneous()) {
      met = clip_homogeneous(in, {origin, ray.direction}, reach);
    } else if (!track.box.isEmpty()) {
      const Vec3d direction = in.density->world_to_index().vector(ray.direction);
      met = clip({origin, direction}, track.box, reach);
      for (int a = 0; a < 3; ++a) {
        packet.origin[static_cast<std::size_t>(a)][r] = static_cast<float>(origin[a] - corner[a]);
        packet.direction[static_cast<std::size_t>(a)][r] = static_cast<float>(direction[a]);
      }
    }
    if (met.is_empty()) continue;
    ++counters.rays;
    packet.begin[r] = static_cast<float>(met.begin);
    packet.end[r] = static_cast<float>(met.end);
    packet.place[r] = ray.place;
    packet.choice[r] = ray.choice;
    const auto before_end =
        std::partition_point(track.steps.begin(), track.steps.end(),
                             [&](const ConeStep& step) { return step.begin < packet.end[r]; });
    const auto before_begin =
        std::partition_point(track.steps.begin(), before_end,
                             [&](const ConeStep& step) { return step.end <= packet.begin[r]; });
    counters.segments += static_cast<std::uint64_t>(before_end - before_begin);
  }
  const std::size_t at = v * s.row_floats();
  ConeDensity density{&s.integral[at], &s.sample[at], {}, {}};
  // Homogeneous ones do not change.
  if (want_gradients && !in.is_homogeneous())
    for (std::size_t a = 0; a < 3; ++a) {
      density.gradient[a] = &s.gradient[a][at];
      density.moment[a] = &s.moment[a][at];
    }
  march_cones(track, packet, density);
}

void ConeMarcher::dim() {
  State& s = *state_;
  const auto& volumes = medium_->volumes();
  const std::size_t row = s.row_floats();
  s.transmittance.resize(static_cast<std::size_t>(s.channels) * row);
  s.end.resize(static_cast<std::size_t>(s.channels) * row);
  for (int c = 0; c < s.channels; ++c) {
    s.depths.assign(row, 0);
    for (std::size_t v = 0; v < volumes.size(); ++v) {
      const auto sigma_t = static_cast<float>(volumes[v].sigma_t()[c]);
      const float* integral = &s.integral[v * row];
      for (std::size_t i = 0; i < row - kConeLanes; ++i) s.depths[i] += sigma_t * integral[i];
    }
    const std::size_t at = static_cast<std::size_t>(c) * row;
    dim_cones(s.rows - 1, s.depths.data(), &s.transmittance[at], &s.end[at]);
  }
}

void ConeMarcher::march(std::span<const ConeRay> rays, bool want_gradients,
                        MarchCounters& counters) {
  State& s = *state_;
  const std::size_t volumes = medium_->volumes().size(), floats = volumes * s.row_floats();
  s.integral.resize(floats);
  s.sample.resize(floats);
  s.has_gradients = want_gradients;
  if (want_gradients)
    for (std::size_t a = 0; a < 3; ++a) {
      s.gradient[a].resize(floats);
      s.moment[a].resize(floats);
    }
  for (std::size_t r = 0; r < rays.size(); ++r) {
    const auto past = std::lower_bound(boundaries_.begin(), boundaries_.end() - 1, rays[r].end);
    s.shell_counts[r] = static_cast<int>(past - boundaries_.begin());
  }
  for (std::size_t v = 0; v < volumes; ++v)
    march_volume(static_cast<int>(v), rays, want_gradients, counters);
  dim();
}

MarchedShells ConeMarcher::ray(int i) const {
  const State& s = *state_;
  MarchedShells view;
  view.shell_count_ = s.shell_counts[static_cast<std::size_t>(i)];
  view.rows_ = s.rows;
  view.stride_ = kConeLanes;
  view.channel_count_ = s.channels;
  view.integral_ = s.integral.data() + i;
  view.sample_ = s.sample.data() + i;
  view.transmittance_ = s.transmittance.data() + i;
  view.end_ = s.end.data() + i;
  if (s.has_gradients)
    for (std::size_t a = 0; a < 3; ++a) {
      view.gradient_[a] = s.gradient[a].data() + i;
      view.moment_[a] = s.moment[a].data() + i;
    }
  return view;
}

}  // namespace brume
