#include "bake/volume_placement.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <numeric>

#include "core/parallel.h"
#include "core/random.h"

namespace brume {
namespace {

// How long a cell may be along an axis: in optical depth, the larger of a least one and a part of
// the depth to the medium's nearer edge or surface; in distance, a part of that to surfaces on
// either side and, where they are close, of their mean distance in six directions; a part of that
// to the nearest lamp. Chosen by furnaces and the smoky box (docs/decisions/0009).
constexpr double kLeastDepth = 0.15, kPartOfDepth = 0.5;
constexpr double kPartOfDistance = 0.7, kPartOfMeanDistance = 0.3;
constexpr double kPartOfLampDistance = 0.7, kNearestLamp = 0.1;
// Radii in lengths of a cell: each place lies in the supports of the cells around it.
constexpr double kCellsInRadius = 1.25;
constexpr int kMostDepth = 40;  // Of the tree.
constexpr std::size_t kMostFirst = 8000, kMostRecords = 20000;
constexpr int kMostWaves = 12;
// A cell is cut where its light differs by more than this part from what its neighbours say, and
// that is more than this part of all light that is scattered; both more where its share is less.
constexpr double kChange = 0.02, kLeastMatter = 1e-5;
constexpr double kCoarserBy = 1.1;    // Where that many would not do.
constexpr double kLeastShare = 1e-4;  // Cells need an end in all but empty space.
constexpr int kTries = 24;            // Places in a cell that may hold medium.
constexpr double kEven = 1.5;         // Most of sigma_s over its mean, in an even cell.
constexpr std::uint64_t kKeyOfVolume = 0x766f6c756d65ULL;

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

// Where light may scatter that gathers or eyes see. A medium without end is looked at as far as
// surfaces and lamps go, and some mean free paths more.
Box3d scattering_box(const World& world) {
  const Medium& medium = world.medium();
  if (!medium.is_unbounded()) return medium.bounds();
  constexpr double kMeanFreePaths = 3;
  Box3d box = world.tracer().bounds();
  for (const auto& light : world.lights())
    if (light->kind() != Light::Kind::Directional && light->kind() != Light::Kind::Environment)
      box.extendBy(light->centre());
  if (box.isEmpty()) box = Box3d(Vec3d(0.0));
  const double sigma = max_component(medium.sigma_t_at((box.min + box.max) * 0.5));
  const double size = (box.max - box.min).length();
  double pad = sigma > 0 ? kMeanFreePaths / sigma : size;
  if (size > 0) pad = std::min(pad, size);
  return {box.min - Vec3d(pad), box.max + Vec3d(pad)};
}

struct Steps {
  Vec3d longest;  // That a cell may be along each axis.
  double share;   // Of light that crosses the surroundings, about which part is scattered there.
};

// Of a cell around p, whose densest place has the extinction `sigma`. What a cell tells wrongly
// grows with the square of its length, and matters by its share.
Steps steps_around(const Lighting& lighting, const Vec3d& p, double sigma, double scale) {
  const World& world = lighting.world();
  const Medium& medium = world.medium();
  double depth[3], distance[3], sum = 0, sum_of_depths = 0;
  int seen = 0;
  std::array<Ray, 6> rays;  // Forth and back along each axis.
  std::array<double, 6> ends;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    Vec3d w(0.0);
    w[static_cast<int>(i / 2)] = i % 2 == 0 ? -1 : 1;
    rays[i] = {p, w};
    const double end = world.tracer().intersect(rays[i]).t;
    double& nearest = distance[i / 2];
    nearest = i % 2 == 0 ? end : std::min(nearest, end);
    if (end < kInfinity) {
      sum += end;
      ++seen;
    }
    ends[i] = std::min(end, medium.is_unbounded() ? 100 / std::max(sigma, 1e-300) : end);
  }
  std::array<RgbD, 6> depths;
  lighting.optical_depths(rays, ends, depths);
  for (std::size_t a = 0; a < 3; ++a) {
    const double back = max_component(depths[2 * a]), forth = max_component(depths[2 * a + 1]);
    depth[a] = std::min(back, forth);
    sum_of_depths += back + forth;
  }
  double lamp = kInfinity;
  for (const auto& light : world.lights())
    if (light->kind() != Light::Kind::Directional && light->kind() != Light::Kind::Environment)
      lamp = std::min(lamp, (light->centre() - p).length());
  const double mean = seen > 0 ? sum / seen : kInfinity;
  Steps steps;
  steps.share = std::max(1 - std::exp(-sum_of_depths / 6), kLeastShare);
  const double wider = 1 / std::sqrt(steps.share);
  for (int a = 0; a < 3; ++a) {
    double step = kInfinity;
    if (sigma > 0) step = std::max(kLeastDepth, kPartOfDepth * depth[a]) / sigma;
    step = std::min(
        step, wider * std::max(2 * kPartOfDistance * distance[a], kPartOfMeanDistance * mean));
    const double nearest = kNearestLamp * (mean < kInfinity ? mean : lamp);
    step = std::min(step, wider * std::max(kPartOfLampDistance * lamp, nearest));
    steps.longest[a] = step * scale;
  }
  return steps;
}

}  // namespace

int harmonic_order(const Medium& medium) {
  double g = 0;
  for (const Volume& v : medium.volumes())
    if (v.scatters()) g = std::max(g, std::abs(double(v.phase.g())));
  if (g == 0) return 0;
  constexpr double kLeftOut = 0.1;
  int order = 1;
  for (double left = g * g; left > kLeftOut && order < kMaxHarmonicOrder; left *= g) ++order;
  return order;
}

Vec3d volume_record_radii(const Lighting& lighting, const Vec3d& p) {
  const double sigma = max_component(lighting.world().medium().sigma_t_at(p));
  return steps_around(lighting, p, sigma, 1).longest * kCellsInRadius;
}

VolumePlacement::VolumePlacement(const Lighting& lighting, const BakeSettings& settings,
                                 const Effects& effects, const Vec3d& origin, int threads,
                                 CacheJournal* journal)
    : lighting_(lighting),
      world_(lighting.world()),
      settings_(settings),
      effects_(effects),
      origin_(origin),
      threads_(threads),
      order_(harmonic_order(lighting.world().medium())),
      journal_(journal),
      box_(scattering_box(lighting.world())) {
  records_.order = order_;
}

// Light is brightest where the medium is dense, and scatters most there: a record for an uneven
// cell lies at a place drawn by sigma_s, so that what the cell scatters comes out right in the mean
// however small its lumps are. Where the medium is even, the middle is the best place there is,
// unless a surface hides the medium from it.
std::optional<VolumePlacement::Site> VolumePlacement::site_of(const Box3d& cell) const {
  const Medium& medium = world_.medium();
  const Vec3d size = cell.max - cell.min, middle = (cell.min + cell.max) * 0.5;
  RandomStream random(kKeyOfVolume);
  Site site{middle, cell};
  Vec3d p = middle, drawn = middle;
  double sum = 0, most = 0;
  for (int i = 0; i < kTries; ++i) {
    const double here = mean_component(medium.sigma_s_at(p));
    sum += here;
    most = std::max(most, here);
    site.densest = std::max<double>(site.densest, max_component(medium.sigma_t_at(p)));
    if (random.uniform() * sum < here) drawn = p;
    const Vec2d u = random.uniform2();
    p = cell.min + Vec3d(u.x * size.x, u.y * size.y, random.uniform() * size.z);
  }
  if (!(sum > 0)) return std::nullopt;
  site.scattering = sum / kTries;
  const Vec3d to = middle - drawn;
  const double distance = to.length();
  const bool is_even = most <= kEven * site.scattering;
  if (!is_even || (distance > 0 && world_.tracer().is_occluded({drawn, to / distance, distance})))
    site.position = drawn;
  return site;
}

void VolumePlacement::cut(const Box3d& cell, double scale, int depth,
                          std::atomic<std::size_t>& placed, std::vector<Site>& sites) const {
  if (placed > kMostFirst) return;
  std::optional<Site> site = site_of(cell);
  if (!site) return;
  const auto [steps, share] = steps_around(lighting_, site->position, site->densest, scale);
  site->share = share;
  const Vec3d size = cell.max - cell.min;
  int axis = 0;
  for (int a = 1; a < 3; ++a)
    if (size[a] * steps[axis] > size[axis] * steps[a]) axis = a;
  if (depth == kMostDepth || !(size[axis] > steps[axis])) {
    sites.push_back(*site);
    ++placed;
    return;
  }
  Box3d low = cell, high = cell;
  low.max[axis] = high.min[axis] = (cell.min[axis] + cell.max[axis]) / 2;
  cut(low, scale, depth + 1, placed, sites);
  cut(high, scale, depth + 1, placed, sites);
}

std::vector<VolumePlacement::Site> VolumePlacement::first_sites(double scale) const {
  // Begins with cells that are about cubes.
  constexpr double kCells = 4;
  const Vec3d size = box_.max - box_.min;
  const double h = std::max({size.x, size.y, size.z}) / kCells;
  int n[3];
  for (int a = 0; a < 3; ++a) n[a] = std::max(1, static_cast<int>(std::ceil(size[a] / h - 1e-9)));
  std::vector<std::vector<Site>> found(std::size_t(n[0]) * n[1] * n[2]);
  std::atomic<std::size_t> placed = 0;
  parallel_for(threads_, found.size(), 1, [&](std::size_t i) {
    const int at[3] = {static_cast<int>(i % n[0]), static_cast<int>(i / n[0] % n[1]),
                       static_cast<int>(i / n[0] / n[1])};
    Box3d cell;
    for (int a = 0; a < 3; ++a) {
      cell.min[a] = box_.min[a] + size[a] * at[a] / n[a];
      cell.max[a] = box_.min[a] + size[a] * (at[a] + 1) / n[a];
    }
    cut(cell, scale, 0, placed, found[i]);
  });
  std::vector<Site> all;
  for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
  return all;
}

bool VolumePlacement::place(const std::function<bool()>& is_stopped) {
  std::vector<Site> fresh = first_sites(1);
  for (double scale = kCoarserBy; fresh.size() > kMostFirst; scale *= kCoarserBy)
    fresh = first_sites(scale);
  for (int wave = 0; wave < kMostWaves && !fresh.empty(); ++wave) {
    if (!gather(fresh, wave, is_stopped)) return false;
    fresh = cut_where_light_changes();
  }
  sort();
  return true;
}

bool VolumePlacement::find(VolumeRecord& record, DeepRow& row) const {
  if (!journal_) return false;
  std::optional<DeepRow> found = row_of(journal_->find_note(record.key));
  if (!found || found->unreflected.size() != std::size_t(harmonic_count(order_))) return false;
  row = std::move(*found);
  return true;
}

void VolumePlacement::gather_one(VolumeGatherer& gatherer, VolumeRecord& r, DeepRow& row,
                                 Counters& counters) const {
  HitLight lamps;
  lamps.reflect = settings_.bounces > 0;
  const VolumeGatherResult g = gatherer.gather(vector(r.position) + origin_,
                                               random_key(settings_.seed, r.key), lamps, counters);
  row.nearest = g.nearest;
  row.error = g.error;
  row.reflected = g.reflected;
  for (std::size_t k = 0; k < g.moments.size(); ++k)
    row.unreflected.push_back(g.moments[k] - g.reflected[k]);
  row.strata = gatherer.strata();
  if (journal_) journal_->add_note(r.key, bytes_of(row));
}

bool VolumePlacement::gather(const std::vector<Site>& sites, int wave,
                             const std::function<bool()>& is_stopped) {
  GatherOptions options = settings_.gather;
  options.gradient = GradientMode::None;
  struct Worker {
    std::unique_ptr<VolumeGatherer> gatherer;
    Counters counters;
  };
  std::vector<Worker> workers(static_cast<std::size_t>(resolve_thread_count(threads_)));
  std::vector<VolumeRecord> fresh(sites.size());
  std::vector<DeepRow> rows(sites.size());
  std::atomic<bool> stopped = false;
  parallel_for_slots(threads_, sites.size(), 1, [&](std::size_t i, int slot) {
    if (stopped || is_stopped()) {
      stopped = true;
      return;
    }
    Worker& worker = workers[static_cast<std::size_t>(slot)];
    if (!worker.gatherer)
      worker.gatherer = std::make_unique<VolumeGatherer>(lighting_, effects_, options, order_);
    VolumeRecord& r = fresh[i];
    const Vec3d local = sites[i].position - origin_, size = sites[i].cell.max - sites[i].cell.min;
    std::uint32_t bits[3];
    for (int a = 0; a < 3; ++a) {
      r.position[a] = static_cast<float>(local[a]);
      r.radius[a] = static_cast<float>(kCellsInRadius * size[a]);
    }
    std::memcpy(bits, r.position, sizeof bits);
    r.key = random_key(kKeyOfVolume, bits[0], bits[1], bits[2]);
    r.axes[0] = 1;
    r.flags = record_flags(kDeepVolumeLayer, wave);
    if (!find(r, rows[i])) gather_one(*worker.gatherer, r, rows[i], worker.counters);
    r.clearance =
        static_cast<float>(std::min<double>(rows[i].nearest, std::numeric_limits<float>::max()));
    r.error = static_cast<float>(rows[i].error);
  });
  for (const Worker& w : workers) counters_ += w.counters;
  if (stopped) return false;
  records_.records.insert(records_.records.end(), fresh.begin(), fresh.end());
  std::move(rows.begin(), rows.end(), std::back_inserter(rows_));
  sites_.insert(sites_.end(), sites.begin(), sites.end());
  return true;
}

// The eighths of cells whose light is not what their neighbours say. A record keeps the eighth that
// it lies in, and its size, so that cells still fill the medium and no place counts twice.
std::vector<VolumePlacement::Site> VolumePlacement::cut_where_light_changes() {
  sort();
  const std::size_t count = records_.size();
  std::vector<double> light(count);
  double all = 0;
  const auto matters = [&](std::size_t i) {
    const Vec3d size = sites_[i].cell.max - sites_[i].cell.min;
    return sites_[i].scattering * size.x * size.y * size.z;
  };
  for (std::size_t i = 0; i < count; ++i) {
    light[i] = luminance(rows_[i].unreflected[0] + rows_[i].reflected[0]);
    all += light[i] * matters(i);
  }
  const VolumeCache cache(records_, origin_);
  const VolumeLookup lookup(world_, cache);
  std::vector<double> error(count);
  parallel_for(threads_, count, 16, [&](std::size_t i) {
    std::vector<VolumePart> parts;
    lookup.find_others(static_cast<std::uint32_t>(i), parts);
    if (parts.empty()) return;
    double there = 0, noise = 0;
    const auto variance = [&](std::size_t record) {
      return double(records_.records[record].error) * records_.records[record].error;
    };
    for (const VolumePart& p : parts) {
      there += p.weight * light[p.record];
      noise += p.weight * p.weight * variance(p.record);
    }
    const double change = std::abs(there - light[i]) - std::sqrt(noise + variance(i));
    if (change > kChange / sites_[i].share * std::max(there, light[i]))
      error[i] = change * sites_[i].share * matters(i);
  });
  std::vector<std::size_t> cut;
  for (std::size_t i = 0; i < count; ++i)
    if (error[i] > kLeastMatter * all) cut.push_back(i);
  const std::size_t room = (kMostRecords - std::min(kMostRecords, count)) / 7;
  if (cut.size() > room) {
    std::stable_sort(cut.begin(), cut.end(),
                     [&](std::size_t a, std::size_t b) { return error[a] > error[b]; });
    cut.resize(room);
  }
  std::vector<Site> eighths;
  for (const std::size_t i : cut) {
    Site& own = sites_[i];
    const Box3d cell = own.cell;
    const Vec3d half = (cell.max - cell.min) * 0.5, from_middle = own.position - (cell.min + half);
    const int of_own = (from_middle.x >= 0) | (from_middle.y >= 0) << 1 | (from_middle.z >= 0) << 2;
    for (int k = 0; k < 8; ++k) {
      const Vec3d low =
          cell.min + Vec3d(half.x * (k & 1), half.y * (k >> 1 & 1), half.z * (k >> 2));
      const Box3d part(low, low + half);
      std::optional<Site> site = site_of(part);
      if (site) site->share = own.share;
      if (k == of_own) {
        own.cell = part;
        own.scattering = site ? site->scattering : 0;
      } else if (site) {
        eighths.push_back(*site);
      }
    }
    for (float& radius : records_.records[i].radius) radius /= 2;
  }
  return eighths;
}

// Into VolumeRecordOrder.
void VolumePlacement::sort() {
  std::vector<std::uint32_t> order(records_.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return VolumeRecordOrder()(records_.records[a], records_.records[b]);
  });
  std::vector<VolumeRecord> records;
  std::vector<DeepRow> rows;
  std::vector<Site> sites;
  for (const std::uint32_t i : order) {
    records.push_back(records_.records[i]);
    rows.push_back(std::move(rows_[i]));
    sites.push_back(sites_[i]);
  }
  records_.records = std::move(records);
  records_.moments.assign(records_.size() * records_.stride(), VolumeMoment{});
  rows_ = std::move(rows);
  sites_ = std::move(sites);
}

}  // namespace brume
