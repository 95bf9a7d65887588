#include "gather/lighting.h"

#include <algorithm>
#include <array>

#include "core/random.h"
#include "gather/bright_patches.h"
#include "vdb_media/depth_marcher.h"

namespace brume {
namespace {

constexpr int kPatchGrid = 3, kPatches = kPatchGrid * kPatchGrid;  // Tables of an area light.
// Patches average each other's errors out, so their tables may be coarser than a point light's.
constexpr double kPatchErrorFactor = 2;
constexpr int kErrorPoints = 1024;  // Points at which the error is measured.
constexpr double kStepVoxels = 2;   // Towards lights without tables.
constexpr int kErrorLightGrid = 3;  // Samples across an area light, each way, at each.

// Patch centres of an area light: the mean of its samples in each cell of the sample square.
// Samples of one cell are spread symmetrically around it, so the first order of the optical depth's
// change over the patch averages out.
std::array<Vec3d, kPatches> patch_centres(const Light& light, const Vec3d& seen_from) {
  constexpr int kGrid = 4;
  std::array<Vec3d, kPatches> centres;
  for (int p = 0; p < kPatches; ++p) {
    Vec3d sum(0.0);
    int n = 0;
    for (int i = 0; i < kGrid * kGrid; ++i) {
      const Vec2d u((p % kPatchGrid + (i % kGrid + 0.5) / kGrid) / kPatchGrid,
                    (p / kPatchGrid + (i / kGrid + 0.5) / kGrid) / kPatchGrid);
      const LightSample s = light.sample(seen_from, u);
      if (!(s.distance < kInfinity) || !(s.distance > 0)) continue;
      sum += seen_from + s.direction * s.distance;
      ++n;
    }
    centres[p] = n > 0 ? sum / n : light.centre();
  }
  return centres;
}

Vec3d random_point(const Box3d& box, RandomStream& random) {
  const Vec2d a = random.uniform2();
  const Vec3d size = box.max - box.min;
  return {box.min.x + a.x * size.x, box.min.y + a.y * size.y,
          box.min.z + random.uniform() * size.z};
}

}  // namespace

Lighting::Lighting(const World& world, const LightingOptions& options)
    : world_(world), options_(options), patches_(std::make_shared<BrightPatches>(world)) {
  for (const Volume& v : world.medium().volumes())
    boxes_.push_back(v.is_homogeneous() ? v.world_bounds() : v.density->world_bounds());
  tables_.resize(world.lights().size());
  const Medium& medium = world.medium();
  if (options.depth == LightDepth::Exact || !medium.is_heterogeneous()) return;
  for (std::size_t v = 0; v < medium.volumes().size(); ++v) {
    const Volume& volume = medium.volumes()[v];
    marchers_.push_back(nullptr);
    if (volume.is_homogeneous()) continue;
    const double voxel = volume.density->voxel_size();
    marchers_.back() = std::make_unique<DepthMarcher>(
        volume, medium.pyramid(static_cast<int>(v)), kStepVoxels * voxel, voxel);
  }
  for (std::size_t l = 0; l < tables_.size(); ++l) {
    const Light& light = *world.lights()[l];
    std::vector<LightOrigin> origins;
    std::vector<Vec3d> centres;
    switch (light.kind()) {
      case Light::Kind::Environment:
        continue;
      case Light::Kind::Directional:
        centres = {Vec3d(0.0)};
        origins = {DirectionOrigin{light.centre()}};
        break;
      case Light::Kind::Point:
      case Light::Kind::Spot:
        centres = {light.centre()};
        origins = {PointOrigin{light.centre()}};
        break;
      case Light::Kind::Quad:
      case Light::Kind::Mesh: {
        const Box3d box = table_box();
        for (const Vec3d& c : patch_centres(light, (box.min + box.max) * 0.5)) {
          centres.push_back(c);
          origins.push_back(PointOrigin{c});
        }
      }
    }
    const double coarser = light.is_delta() ? 1 : kPatchErrorFactor;
    for (std::size_t i = 0; i < origins.size(); ++i) {
      Table table{centres[i], {}};
      for (std::size_t v = 0; v < medium.volumes().size(); ++v) {
        const Volume& volume = medium.volumes()[v];
        table.volumes.push_back(nullptr);
        if (volume.is_homogeneous()) continue;
        const LightVolumeOptions volume_options{.target_error = coarser * options.target_error,
                                                .threads = options.threads,
                                                .pyramid = &medium.pyramid(static_cast<int>(v))};
        table.volumes.back() = std::make_unique<LightVolume>(volume, origins[i], volume_options);
      }
      tables_[l].push_back(std::move(table));
    }
  }
  measure_error();
}

Lighting::~Lighting() = default;

// What tables cover: all grids together. Homogeneous volumes, which may have no end, need none.
Box3d Lighting::table_box() const {
  Box3d box;
  for (std::size_t v = 0; v < boxes_.size(); ++v)
    if (!world_.medium().volumes()[v].is_homogeneous()) box.extendBy(boxes_[v]);
  return box;
}

const Lighting::Table& Lighting::table(int light, const Vec3d& point_on_light) const {
  const std::vector<Table>& tables = tables_[light];
  std::size_t best = 0;
  for (std::size_t i = 1; i < tables.size(); ++i)
    if ((tables[i].centre - point_on_light).length2() <
        (tables[best].centre - point_on_light).length2())
      best = i;
  return tables[best];
}

RgbD Lighting::exact_depth(const LightSample& sample, const Vec3d& p, Counters& counters) const {
  MarchCounters march;
  const RgbD tau = optical_depth(world_.medium(), Ray{p, sample.direction}, {0, sample.distance},
                                 options_.march, march);
  counters.march_rays += march.rays;
  counters.segments += march.segments;
  return tau;
}

RgbD Lighting::transmittance(int light, const LightSample& sample, const Vec3d& p,
                             Counters& counters) const {
  if (world_.medium().is_vacuum()) return RgbD(1);
  if (tables_[light].empty()) return exp_neg(exact_depth(sample, p, counters));
  return tabulated(light, sample, p, counters);
}

void Lighting::optical_depths(std::span<const Ray> rays, std::span<const double> ends,
                              std::span<RgbD> depths) const {
  const auto& volumes = world_.medium().volumes();
  MarchCounters unused;
  for (std::size_t first = 0; first < rays.size(); first += DepthMarcher::kRays) {
    const std::size_t count = std::min<std::size_t>(DepthMarcher::kRays, rays.size() - first);
    for (std::size_t i = first; i < first + count; ++i)
      depths[i] = marchers_.empty() ? optical_depth(world_.medium(), rays[i], {0, ends[i]},
                                                    options_.march, unused)
                                    : RgbD();
    for (std::size_t v = 0; v < marchers_.size(); ++v) {
      std::array<float, DepthMarcher::kRays> integrals{};
      if (marchers_[v]) {
        marchers_[v]->march(rays.subspan(first, count), ends.subspan(first, count),
                            {integrals.data(), count});
      } else {
        for (std::size_t i = 0; i < count; ++i)
          integrals[i] = static_cast<float>(
              density_integral(volumes[v], rays[first + i], {0, ends[first + i]}, {}, unused));
      }
      const RgbD sigma_t = volumes[v].sigma_t();
      for (std::size_t i = 0; i < count; ++i)
        for (int c = 0; c < 3; ++c)
          // An endless path through what dims nothing is nothing.
          if (sigma_t[c] > 0) depths[first + i][c] += sigma_t[c] * double(integrals[i]);
    }
  }
}

void Lighting::transmittances(std::span<const Request> requests, std::span<RgbD> found,
                              Counters& counters) const {
  std::array<std::size_t, DepthMarcher::kRays> which;
  std::array<Ray, DepthMarcher::kRays> rays;
  std::array<double, DepthMarcher::kRays> ends;
  std::array<RgbD, DepthMarcher::kRays> depths;
  std::size_t count = 0;
  const auto march = [&] {
    optical_depths({rays.data(), count}, {ends.data(), count}, {depths.data(), count});
    for (std::size_t i = 0; i < count; ++i) found[which[i]] = exp_neg(depths[i]);
    counters.march_rays += count;
    count = 0;
  };
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const Request& r = requests[i];
    // Without marchers tables are not wanted, or there is nothing to march through.
    if (marchers_.empty() || !tables_[r.light].empty()) {
      found[i] = transmittance(r.light, r.sample, r.p, counters);
      continue;
    }
    which[count] = i;
    rays[count] = {r.p, r.sample.direction};
    ends[count++] = r.sample.distance;
    if (count == which.size()) march();
  }
  if (count > 0) march();
}

RgbD Lighting::tabulated(int light, const LightSample& sample, const Vec3d& p,
                         Counters& counters) const {
  const Medium& medium = world_.medium();
  const Ray ray{p, sample.direction};
  const Table& t = table(light, tables_[light].size() > 1 ? ray.at(sample.distance) : p);
  RgbD tau;
  for (std::size_t v = 0; v < medium.volumes().size(); ++v) {
    const Volume& volume = medium.volumes()[v];
    const Interval inside = clip(ray, boxes_[v], {0, sample.distance});
    if (t.volumes[v] == nullptr) {
      if (!inside.is_empty()) tau += volume.sigma_t() * (inside.end - inside.begin);
      continue;
    }
    // Density ends at the box, so a point outside it sees what the point where its ray enters sees.
    if (inside.is_empty()) continue;
    tau += volume.sigma_t() * t.volumes[v]->density_integral(ray.at(inside.begin));
    ++counters.light_volume_lookups;
  }
  return exp_neg(tau);
}

// Of the transmittance that light arrives with, averaged over the light as pictures average it.
void Lighting::measure_error() {
  const Box3d box = table_box();
  if (box.isEmpty() || tables_.empty()) return;
  RandomStream random(random_key(0x6c69676874ULL));
  Counters ignored;
  double sum = 0;
  int n = 0;
  for (int i = 0; i < kErrorPoints; ++i) {
    const int l = i % static_cast<int>(tables_.size());
    const Light& light = *world_.lights()[l];
    const Vec3d p = random_point(box, random);
    if (is_black(world_.medium().sigma_t_at(p))) continue;
    double weights = 0, error = 0;
    const int grid = light.is_delta() ? 1 : kErrorLightGrid;
    for (int k = 0; k < grid * grid; ++k) {
      const Vec2d u = random.uniform2();
      const LightSample s = light.sample(p, {(k % grid + u.x) / grid, (k / grid + u.y) / grid});
      const double weight = luminance(s.weight);
      if (!(weight > 0)) continue;
      weights += weight;
      RgbD found;
      const Request request{l, s, p};
      transmittances({&request, 1}, {&found, 1}, ignored);
      error += weight * (luminance(found) - luminance(exp_neg(exact_depth(s, p, ignored))));
    }
    if (!(weights > 0)) continue;
    error /= weights;
    sum += error * error;
    ++n;
    max_error_ = std::max(max_error_, std::abs(error));
  }
  rms_error_ = n > 0 ? std::sqrt(sum / n) : 0;
}

std::size_t Lighting::memory_bytes() const {
  std::size_t bytes = 0;
  for (const auto& tables : tables_)
    for (const Table& t : tables)
      for (const auto& v : t.volumes) bytes += v ? v->memory_bytes() : 0;
  return bytes;
}

}  // namespace brume
