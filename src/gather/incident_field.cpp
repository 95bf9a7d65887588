#include "gather/incident_field.h"

#include <algorithm>

#include "core/parallel.h"

namespace brume {
namespace {

// Nodes in the radius of small records: between nodes moments are linear, records themselves blend
// over their radius.
constexpr double kNodesInRadius = 2;
constexpr double kLeastNodes = 32768, kNodesOfRecord = 64;
// The part of records whose radii may be smaller than what the node distance follows.
constexpr double kSmallestPart = 0.1;

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

// Whether a triangle's plane passes a box of half width `half` around `centre`.
bool meets_plane(const Vec3d& corner, const Vec3d& normal, const Vec3d& centre, double half) {
  const double reach = half * (std::abs(normal.x) + std::abs(normal.y) + std::abs(normal.z));
  return std::abs((centre - corner).dot(normal)) <= reach;
}

}  // namespace

IncidentField::IncidentField(const World& world, std::shared_ptr<const VolumeCache> cache,
                             int threads)
    : records_(std::move(cache)), lookup_(world, *records_), order_(records_->order()) {
  choose_grid(world, *records_);
  if (size_[0] == 0) return;
  mark_surfaces(world);
  fill(world, threads);
}

void IncidentField::choose_grid(const World& world, const VolumeCache& cache) {
  const std::size_t count = cache.size();
  if (count == 0) return;
  Box3d all;
  std::vector<float> radii;
  for (const VolumeRecord& r : cache.all().records) {
    const float least = *std::min_element(r.radius, r.radius + 3);
    radii.push_back(least);
    const Vec3d p = vector(r.position) + cache.origin();
    all.extendBy(p - Vec3d(double(least)));
    all.extendBy(p + Vec3d(double(least)));
  }
  // Layers of thin records at the medium's edges are worth no grid of their size everywhere.
  const double most_nodes = std::min(double(kMostBytes / (stride() * sizeof(float))),
                                     std::max(kLeastNodes, kNodesOfRecord * double(count)));
  const auto typical = radii.begin() + static_cast<std::ptrdiff_t>(kSmallestPart * double(count));
  std::nth_element(radii.begin(), typical, radii.end());
  const Box3d& medium = world.medium().bounds();
  for (int a = 0; a < 3; ++a) {
    box_.min[a] = std::max(all.min[a], medium.min[a]);
    box_.max[a] = std::min(all.max[a], medium.max[a]);
  }
  const Vec3d extent = box_.max - box_.min;
  if (!(std::min({extent.x, extent.y, extent.z}) > 0)) return;
  for (step_ = *typical / kNodesInRadius;; step_ *= 1.1) {
    double nodes = 1;
    for (int a = 0; a < 3; ++a) nodes *= std::floor(extent[a] / step_) + 2;
    if (nodes <= most_nodes) break;
  }
  for (int a = 0; a < 3; ++a) size_[a] = static_cast<int>(std::floor(extent[a] / step_)) + 2;
}

void IncidentField::mark_surfaces(const World& world) {
  is_direct_.assign(node(0, 0, size_[2]), 0);
  const double half = step_ * 0.501;
  for (const TriangleMesh& mesh : world.tracer().meshes())
    for (const auto& [a, b, c] : mesh.triangles) {
      const Vec3d corners[3] = {mesh.positions[a], mesh.positions[b], mesh.positions[c]};
      Box3d box;
      for (const Vec3d& p : corners) box.extendBy(p);
      const Vec3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
      int first[3], last[3];
      for (int i = 0; i < 3; ++i) {
        const double low = std::floor((box.min[i] - box_.min[i]) / step_ - 1e-3);
        const double high = std::floor((box.max[i] - box_.min[i]) / step_ + 1e-3);
        first[i] = static_cast<int>(std::clamp(low, 0.0, double(size_[i] - 1)));
        last[i] = static_cast<int>(std::clamp(high, -1.0, double(size_[i] - 2)));
      }
      for (int z = first[2]; z <= last[2]; ++z)
        for (int y = first[1]; y <= last[1]; ++y)
          for (int x = first[0]; x <= last[0]; ++x)
            if (meets_plane(corners[0], normal, node_position(x, y, z) + Vec3d(step_ / 2), half))
              is_direct_[node(x, y, z)] = 1;
    }
}

void IncidentField::fill(const World& world, int threads) {
  const auto is_in_medium = [&](const Vec3d& p) { return !is_black(world.medium().sigma_t_at(p)); };
  moments_.assign(node(0, 0, size_[2]) * stride(), 0);
  // Cells without medium near any node or the middle are rarely asked: not worth their nodes.
  std::vector<std::uint8_t> has_medium(is_direct_.size());
  parallel_for(threads, has_medium.size(), 256, [&](std::size_t i) {
    const int x = static_cast<int>(i % size_[0]), y = static_cast<int>(i / size_[0] % size_[1]),
              z = static_cast<int>(i / size_[0] / size_[1]);
    const Vec3d p = node_position(x, y, z);
    has_medium[i] = is_in_medium(p) || is_in_medium(p + Vec3d(step_ / 2));
  });
  const auto is_needed = [&](int x, int y, int z) {
    for (int i = 0; i < 27; ++i) {
      const int nx = x + i % 3 - 1, ny = y + i / 3 % 3 - 1, nz = z + i / 9 - 1;
      if (nx >= 0 && ny >= 0 && nz >= 0 && nx < size_[0] && ny < size_[1] && nz < size_[2] &&
          has_medium[node(nx, ny, nz)])
        return true;
    }
    return false;
  };
  std::vector<std::uint8_t> is_filled(is_direct_.size());
  parallel_for(threads, is_direct_.size(), 64, [&](std::size_t i) {
    const int x = static_cast<int>(i % size_[0]), y = static_cast<int>(i / size_[0] % size_[1]),
              z = static_cast<int>(i / size_[0] / size_[1]);
    if (!is_needed(x, y, z)) return;
    lookup_.moments(node_position(x, y, z), {&moments_[i * stride()], stride()});
    is_filled[i] = 1;
  });
  for (int z = 0; z + 1 < size_[2]; ++z)
    for (int y = 0; y + 1 < size_[1]; ++y)
      for (int x = 0; x + 1 < size_[0]; ++x)
        for (int i = 0; i < 8; ++i)
          if (!is_filled[node(x + (i & 1), y + (i >> 1 & 1), z + (i >> 2))])
            is_direct_[node(x, y, z)] = 1;
}

bool IncidentField::find(const Vec3d& p, Place& place) const {
  if (size_[0] == 0) return false;
  for (int a = 0; a < 3; ++a) {
    const double at = (p[a] - box_.min[a]) / step_;
    if (!(at >= 0 && at < size_[a] - 1)) return false;
    place.at[a] = static_cast<int>(at);
    place.part[a] = static_cast<float>(at - place.at[a]);
  }
  place.cell = node(place.at[0], place.at[1], place.at[2]);
  return is_direct_[place.cell] == 0;
}

RgbD IncidentField::dot_signed(const Vec3d& at, std::span<const double> weights) const {
  Vec3d p = at;
  if (size_[0] > 0)
    for (int a = 0; a < 3; ++a) p[a] = std::clamp(p[a], box_.min[a], box_.max[a]);
  const auto times = [&](const float* m) {
    RgbD sum;
    for (std::size_t k = 0; k < weights.size(); ++k)
      sum += RgbD(m[3 * k], m[3 * k + 1], m[3 * k + 2]) * weights[k];
    return sum;
  };
  Place place;
  if (!find(p, place)) {
    std::array<float, 3 * kMaxHarmonics> here;
    lookup_.moments(p, {here.data(), stride()});
    return times(here.data());
  }
  RgbD sum;
  for (int i = 0; i < 8; ++i) {
    const int x = i & 1, y = i >> 1 & 1, z = i >> 2;
    const double weight = double(x ? place.part[0] : 1 - place.part[0]) *
                          (y ? place.part[1] : 1 - place.part[1]) *
                          (z ? place.part[2] : 1 - place.part[2]);
    sum += times(&moments_[(place.cell + node(x, y, z)) * stride()]) * weight;
  }
  return sum;
}

RgbD IncidentField::dot(const Vec3d& p, std::span<const double> weights) const {
  RgbD sum = dot_signed(p, weights);
  for (int c = 0; c < 3; ++c) sum[c] = std::max(0.0, sum[c]);
  return sum;
}

RgbD IncidentField::moment(const Vec3d& p, int k) const {
  Harmonics unit{};
  unit[k] = 1;
  return dot_signed(p, {unit.data(), static_cast<std::size_t>(k + 1)});
}

}  // namespace brume
