#include "bake/work_units.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>

#include "core/random.h"

namespace brume {
namespace {

// Cells are this many to twice as many resolutions wide.
constexpr double kCellWidth = 32;

std::uint64_t cell_of(const float* position, double resolution) {
  const double least = kCellWidth * resolution;
  const int level = least > 0 && std::isfinite(least)
                        ? std::clamp(static_cast<int>(std::ceil(std::log2(least))), -100, 100)
                        : -100;
  std::int64_t at[3];
  for (int a = 0; a < 3; ++a) {
    const double cell = std::floor(std::ldexp(double(position[a]), -level));
    at[a] = static_cast<std::int64_t>(std::clamp(cell, -0x1p62, 0x1p62));
  }
  return random_key(level, at[0], at[1], at[2]);
}

}  // namespace

std::uint64_t record_key(const float* position, const float* normal, double unit) {
  std::uint32_t bits[6];
  float metres[3];
  for (int a = 0; a < 3; ++a) metres[a] = static_cast<float>(position[a] * unit);
  std::memcpy(bits, metres, sizeof metres);
  std::memcpy(bits + 3, normal, 3 * sizeof(float));
  return random_key(bits[0], bits[1], bits[2], bits[3], bits[4], bits[5]);
}

std::uint32_t WorkUnits::add_batch(const CandidateBatch& batch) {
  batches_.push_back(batch);
  return static_cast<std::uint32_t>(batches_.size() - 1);
}

void WorkUnits::add(std::uint32_t batch, const SurfacePoint& point, double resolution) {
  Candidate c;
  const Vec3d local = point.position - origin_;
  for (int a = 0; a < 3; ++a) {
    c.position[a] = static_cast<float>(local[a]);
    c.normal[a] = static_cast<float>(point.normal[a]);
  }
  float metres[3];  // So that cells do not depend on the unit.
  for (int a = 0; a < 3; ++a) metres[a] = static_cast<float>(c.position[a] * unit_);
  c.cell = cell_of(metres, resolution * unit_);
  c.offset = point.offset;
  c.min_radius = static_cast<float>(point.min_radius);
  c.batch = batch;
  candidates_.push_back(c);
}

std::vector<WorkUnit> WorkUnits::units() {
  // Views may see the very same point from different distances, which is in two cells then. Only
  // the one that asks for more is kept: no two units ever make the same record.
  std::vector<std::tuple<std::uint64_t, float, std::uint32_t>> order(candidates_.size());
  for (std::uint32_t i = 0; i < candidates_.size(); ++i)
    order[i] = {record_key(candidates_[i].position, candidates_[i].normal, unit_),
                candidates_[i].min_radius, i};
  std::sort(order.begin(), order.end());
  std::vector<std::uint8_t> is_kept(candidates_.size(), 1);
  for (std::size_t i = 1; i < order.size(); ++i)
    if (std::get<0>(order[i]) == std::get<0>(order[i - 1])) is_kept[std::get<2>(order[i])] = 0;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < candidates_.size(); ++i)
    if (is_kept[i]) candidates_[kept++] = candidates_[i];
  candidates_.resize(kept);

  std::stable_sort(candidates_.begin(), candidates_.end(),
                   [](const Candidate& a, const Candidate& b) {
                     return a.cell != b.cell ? a.cell < b.cell : a.batch < b.batch;
                   });
  std::vector<WorkUnit> units;
  for (std::size_t begin = 0; begin < candidates_.size();) {
    std::size_t end = begin;
    while (end < candidates_.size() && candidates_[end].cell == candidates_[begin].cell) ++end;
    units.emplace_back(&candidates_[begin], end - begin);
    begin = end;
  }
  return units;
}

}  // namespace brume
