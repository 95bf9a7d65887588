#include "gather/direction_cells.h"

#include <algorithm>
#include <cstdint>

#include "core/lattice.h"

namespace brume {
namespace {

constexpr int kCellsAtTheNormal = 3;
// Cells are max(1, kWideness sin^2 theta) times as wide as they are high: most of what stands on or
// near the receiver's plane has upright edges, which short walls between wide cells follow best.
constexpr double kWideness = 3;

Vec3d spherical(double s, double phi, double c) {
  return {s * std::cos(phi), s * std::sin(phi), c};
}
double fraction(double x) { return x - std::floor(x); }

}  // namespace

// sin^2 theta or (1 - cos theta) / 2.
DirectionCells::Latitude DirectionCells::latitude(double part) const {
  if (domain_ == DirectionDomain::Hemisphere)
    return {std::sqrt(part), std::sqrt(std::max(0.0, 1 - part))};
  const double cosine = 1 - 2 * part;
  return {std::sqrt(std::max(0.0, 1 - cosine * cosine)), cosine};
}

// Cells of the ring that begins at that part of all, where each has 1/count of it.
int DirectionCells::cells_of_ring(double begin, int count) const {
  if (domain_ == DirectionDomain::Sphere) {
    // A square of as much solid angle, on the sphere.
    const double height = std::sqrt(4 * kPi / count);
    const double theta = std::min(kPi, std::acos(1 - 2 * begin) + height / 2);
    return std::max(kCellsAtTheNormal,
                    static_cast<int>(std::lround(2 * kPi * std::sin(theta) / height)));
  }
  const double s = std::sqrt(begin), area = kPi / count;
  const double height = std::sqrt(area / std::max(1.0, kWideness * s * s));
  return std::max(kCellsAtTheNormal,
                  static_cast<int>(std::lround(2 * kPi * (s + height / 2) * height / area)));
}

DirectionCells::DirectionCells(int count, DirectionDomain domain) : domain_(domain) {
  if (domain == DirectionDomain::Sphere) count = std::max(count, 2 * kCellsAtTheNormal);
  for (int done = 0; done < count;) {
    const double begin = double(done) / count;
    int in_ring = cells_of_ring(begin, count);
    // What would be left for a ring of its own is better off in this one.
    if (2 * (count - done) < 3 * in_ring) in_ring = count - done;
    rings_.push_back({done, in_ring, begin, double(done + in_ring) / count});
    ring_of_.insert(ring_of_.end(), in_ring, static_cast<int>(rings_.size()) - 1);
    done += in_ring;
  }
  add_cells();
  for (std::size_t i = 0; i < rings_.size(); ++i) {
    add_walls_within(rings_[i]);
    if (i > 0) add_walls_between(rings_[i - 1], rings_[i]);
  }
  number_sides();
}

void DirectionCells::add_cells() {
  for (const Ring& ring : rings_) {
    const auto [s0, c0] = latitude(ring.begin);
    const auto [s1, c1] = latitude(ring.end);
    const double dphi = 2 * kPi / ring.count, chord = 2 * std::sin(dphi / 2);
    const double turn = (std::atan2(s1, c1) - s1 * c1) - (std::atan2(s0, c0) - s0 * c0);
    for (int k = 0; k < ring.count; ++k) {
      const double centre = (k + 0.5) * dphi;
      DirectionCell cell;
      cell.measure = measure() * (ring.end - ring.begin) / ring.count;
      if (domain_ == DirectionDomain::Sphere) {
        cell.direction =
            spherical(chord / 2 * turn, centre, dphi / 2 * (s1 * s1 - s0 * s0));
      } else {
        cell.direction = spherical(chord * (s1 * s1 * s1 - s0 * s0 * s0) / 3, centre,
                                   dphi * (c0 * c0 * c0 - c1 * c1 * c1) / 3);
        cell.rotation = spherical(chord / 2 * turn, centre + kPi / 2, 0);  // n x u.
      }
      cells_.push_back(cell);
    }
  }
}

void DirectionCells::add_walls_within(const Ring& ring) {
  const auto [s0, c0] = latitude(ring.begin);
  const auto [s1, c1] = latitude(ring.end);
  const auto middle = latitude(0.5 * (ring.begin + ring.end));
  const double height = domain_ == DirectionDomain::Sphere
                            ? std::atan2(s1, c1) - std::atan2(s0, c0)
                            : s1 - s0;
  const double dphi = 2 * kPi / ring.count;
  for (int k = 0; k < ring.count; ++k)
    walls_.push_back({ring.first + (k + ring.count - 1) % ring.count, ring.first + k, 0, 0,
                      spherical(height, k * dphi + kPi / 2, 0),
                      spherical(middle.sine, k * dphi, middle.cosine)});
}

void DirectionCells::add_walls_between(const Ring& inner, const Ring& outer) {
  const auto [s, c] = latitude(outer.begin);
  const double weight = domain_ == DirectionDomain::Sphere ? 1 : c;
  double begin = 0;
  for (std::int64_t i = 0, o = 0; i < inner.count && o < outer.count;) {
    // Compared as integers: where both rings are cut, both move on.
    const std::int64_t inner_end = (i + 1) * outer.count, outer_end = (o + 1) * inner.count;
    const double end = inner_end <= outer_end ? 2 * kPi * double(i + 1) / inner.count
                                              : 2 * kPi * double(o + 1) / outer.count;
    const double centre = 0.5 * (begin + end), dphi = end - begin;
    walls_.push_back({inner.first + static_cast<int>(i), outer.first + static_cast<int>(o), 0, 0,
                      spherical(2 * std::sin(dphi / 2) * s * c * weight, centre, -dphi * s * s * weight),
                      spherical(s, centre, c)});
    begin = end;
    i += inner_end <= outer_end;
    o += outer_end <= inner_end;
  }
}

void DirectionCells::number_sides() {
  std::vector<int> sides(cells_.size());
  for (const CellWall& wall : walls_) {
    ++sides[wall.low];
    ++sides[wall.high];
  }
  int next = 0;
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    cells_[c].first_side = cells_[c].end_side = next;
    next += sides[c];
  }
  for (CellWall& wall : walls_) {
    wall.low_side = cells_[wall.low].end_side++;
    wall.high_side = cells_[wall.high].end_side++;
  }
}

Vec3d DirectionCells::direction(int c, const Vec2d& shift) const {
  const int row = ring_of_[c];
  const Ring& ring = rings_[row];
  const int column = c - ring.first;
  const double up = fraction(shift.x + row * kLatticeX + column * kLatticeY);
  const double along = fraction(shift.y + row * kLatticeY + column * kLatticeX);
  const Latitude at = latitude(ring.begin + (ring.end - ring.begin) * up);
  return spherical(at.sine, (column + along) * (2 * kPi / ring.count), at.cosine);
}

int DirectionCells::cell_at(const Vec3d& direction) const {
  const bool is_sphere = domain_ == DirectionDomain::Sphere;
  if (!is_sphere && !(direction.z > 0)) return -1;
  const double part = is_sphere ? 0.5 * (1 - direction.z)
                                : direction.x * direction.x + direction.y * direction.y;
  auto ring = std::upper_bound(rings_.begin(), rings_.end(), part,
                               [](double at, const Ring& r) { return at < r.end; });
  if (ring == rings_.end()) --ring;
  const double turns = std::atan2(direction.y, direction.x) / (2 * kPi);
  const int column = static_cast<int>((turns - std::floor(turns)) * ring->count);
  return ring->first + std::min(column, ring->count - 1);
}

}  // namespace brume
