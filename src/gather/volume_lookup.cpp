#include "gather/volume_lookup.h"

#include <algorithm>

namespace brume {
namespace {

// The nearest surface that a record's gather met is not quite the nearest there is: its rays have
// gaps.
constexpr double kCertain = 0.7;
// Of the largest weight, what counts beside it.
constexpr double kMatters = 2e-3;
// Of the most that scatters at any record: those in all but empty space still count a little.
constexpr double kLeastScattering = 1e-6;

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

}  // namespace

VolumeLookup::VolumeLookup(const World& world, const VolumeCache& cache)
    : world_(world), cache_(cache) {
  least_radius_ = kInfinity;
  for (const VolumeRecord& r : cache.all().records)
    least_radius_ = std::min<double>(least_radius_, *std::min_element(r.radius, r.radius + 3));
  find_scattering();
}

void VolumeLookup::find_scattering() {
  std::vector<double> all;
  for (const VolumeRecord& r : cache_.all().records)
    all.push_back(mean_component(world_.medium().sigma_s_at(vector(r.position) + cache_.origin())));
  const double most = all.empty() ? 0 : *std::max_element(all.begin(), all.end());
  for (const double here : all)
    scattering_.push_back(most > 0 ? static_cast<float>(std::max(here / most, kLeastScattering))
                                   : 1);
}

bool VolumeLookup::is_visible(const Vec3d& p, std::uint32_t record) const {
  const VolumeRecord& r = cache_.all().records[record];
  const Vec3d to = vector(r.position) + cache_.origin() - p;
  const double distance = to.length();
  if (distance < kCertain * r.clearance) return true;
  return !world_.tracer().is_occluded({p, to / distance, distance * (1 - 1e-5)});
}

// Weights that nearly reproduce what is linear, and the closest to the kernel's [AO06]:
// w_i = k_i exp(lambda . d_i) with lambda least for log sum w_i + kSoftness lambda^2 / 2. They are
// positive, so that transport stays so. Exactly linear ones (no softness) would count records in
// thin smoke at a lump's edge, however dark they are, as much as balances those in the lump.
void VolumeLookup::centre(std::vector<VolumePart>& parts, std::span<const Vec3d> offsets) const {
  constexpr int kSteps = 6;
  constexpr double kLargest = 4, kCentred = 0.02, kSoftness = 0.1;
  const std::size_t n = parts.size();
  if (n < 2) return;
  // Supports may be flat: each axis counts in its own scale.
  Vec3d scale(0.0);
  for (const Vec3d& d : offsets)
    for (int a = 0; a < 3; ++a) scale[a] = std::max(scale[a], std::abs(d[a]));
  for (int a = 0; a < 3; ++a)
    if (!(scale[a] > 0)) scale[a] = 1;
  Vec3d lambda(0.0);
  double w[kMostParts];
  for (int step = 0;; ++step) {
    double sum = 0, h[6] = {};
    Vec3d mean(0.0);
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3d d = offsets[i] / scale;
      w[i] = parts[i].weight * std::exp(lambda.dot(d));
      sum += w[i];
      mean += d * w[i];
      h[0] += w[i] * d.x * d.x;
      h[1] += w[i] * d.x * d.y;
      h[2] += w[i] * d.x * d.z;
      h[3] += w[i] * d.y * d.y;
      h[4] += w[i] * d.y * d.z;
      h[5] += w[i] * d.z * d.z;
    }
    mean /= sum;
    const Vec3d slope = mean + lambda * kSoftness;
    if (step == kSteps || slope.length() < kCentred) {
      for (std::size_t i = 0; i < n; ++i) parts[i].weight = static_cast<float>(w[i] / sum);
      return;
    }
    // The covariance is the second derivative of log sum w.
    const double xx = h[0] / sum - mean.x * mean.x + kSoftness, xy = h[1] / sum - mean.x * mean.y,
                 xz = h[2] / sum - mean.x * mean.z, yy = h[3] / sum - mean.y * mean.y + kSoftness,
                 yz = h[4] / sum - mean.y * mean.z, zz = h[5] / sum - mean.z * mean.z + kSoftness;
    const Vec3d a(xx, xy, xz), b(xy, yy, yz), c(xz, yz, zz);
    const double det = a.dot(b.cross(c));
    lambda -= Vec3d(slope.dot(b.cross(c)), a.dot(slope.cross(c)), a.dot(b.cross(slope))) / det;
    if (lambda.length() > kLargest) lambda *= kLargest / lambda.length();
  }
}

// Kernels are of one mass each, where all scatter alike: a wide record reaches over many narrow
// ones, which were placed because it cannot tell what changes between them. Where smoke is dense
// light is bright, and most of it scatters there: a record in thin smoke says little about that.
double VolumeLookup::density(std::uint32_t record, double min_radius) const {
  double product = scattering_[record];
  for (const float radius : cache_.all().records[record].radius)
    product *= least_radius_ / std::max<double>(radius, min_radius);
  return product;
}

void VolumeLookup::find(const Vec3d& p, std::vector<VolumePart>& parts) const {
  find(p, kNobody, parts);
}

void VolumeLookup::find_others(std::uint32_t record, std::vector<VolumePart>& parts) const {
  find(vector(cache_.all().records[record].position) + cache_.origin(), record, parts);
}

void VolumeLookup::find(const Vec3d& p, std::uint32_t but, std::vector<VolumePart>& parts) const {
  parts.clear();
  thread_local std::vector<Vec3d> offsets;
  thread_local std::vector<double> masses;
  offsets.clear();
  VolumeQuery query{kDeepVolumeLayer, p, 0};
  for (int doubling = 0; doubling <= kMostDoublings && parts.empty(); ++doubling) {
    const auto near = cache_.explain(query);
    masses.clear();
    for (const auto& [record, weight] : near)
      masses.push_back(record == but ? 0 : weight * weight * density(record, query.min_radius));
    // Those that hardly matter are asked only where a surface hides all others.
    const double most = masses.empty() ? 0 : *std::max_element(masses.begin(), masses.end());
    for (const Interval of : {Interval{kMatters * most, kInfinity}, Interval{0, kMatters * most}}) {
      for (std::size_t i = 0; i < near.size() && parts.size() < kMostParts; ++i) {
        const std::uint32_t record = near[i].first;
        if (!(masses[i] > of.begin && masses[i] <= of.end) || !is_visible(p, record)) continue;
        parts.push_back({record, static_cast<float>(masses[i] / most)});
        offsets.push_back(vector(cache_.all().records[record].position) + cache_.origin() - p);
      }
      if (!parts.empty()) break;
    }
    // Surrounded by records that surfaces hide, as inside a solid.
    if (near.size() >= kMostParts) break;
    query.min_radius = 2 * std::max(query.min_radius, least_radius_);
  }
  if (parts.empty()) return;
  double sum = 0;
  for (const VolumePart& part : parts) sum += part.weight;
  for (VolumePart& part : parts) part.weight = static_cast<float>(part.weight / sum);
  centre(parts, offsets);
}

bool VolumeLookup::covers(const Vec3d& p) const {
  for (const auto& [record, weight] : cache_.explain({kDeepVolumeLayer, p, 0}))
    if (is_visible(p, record)) return true;
  return false;
}

bool VolumeLookup::moments(const Vec3d& p, std::span<float> out) const {
  std::fill(out.begin(), out.end(), 0.0f);
  thread_local std::vector<VolumePart> parts;
  find(p, parts);
  for (const VolumePart& part : parts) {
    const std::span<const VolumeMoment> moments = cache_.all().moments_of(part.record);
    for (std::size_t k = 0; k < moments.size(); ++k)
      for (int c = 0; c < 3; ++c) out[3 * k + c] += part.weight * moments[k].value[c];
  }
  return !parts.empty();
}

}  // namespace brume
