#include "segments.h"

#include <algorithm>
#include <memory>

namespace brume {
namespace {

constexpr int kNodes = BrickGrid::kNodes;
constexpr std::size_t kAlignment = 64;

// The cell of a place, given in node units from the brick's corner. Rounding may put it a hair
// outside, where the nearest cell continues the field.
inline void put(const Field& field, const Span& span, double begin, double middle, double length,
                Segments& s, int i) {
  s.begin[i] = begin;
  s.middle[i] = middle;
  s.length[i] = length;
  double p[3], cell[3];
  for (int a = 0; a < 3; ++a) {
    p[a] = field.ray.at(a, middle) - span.corner[a];
    cell[a] = int(std::min(std::max(p[a], 0.0), double(kNodes - 2)));
    s.fraction[a][i] = float(p[a] - cell[a]);
  }
  s.offset[i] = span.offset + std::int64_t(cell[0] + kNodes * cell[1] + kNodes * kNodes * cell[2]);
}

void collect_scalar(const Field& field, const Span* spans, int span_count, const double* cuts,
                    Segments& segments) {
  const IndexRay& ray = field.ray;
  segments.tiles.clear();
  segments.count = 0;
  for (int n = 0; n < span_count; ++n) {
    const Span& span = spans[n];
    if (span.tile >= 0) {
      collect_tile(span, cuts, segments);
      continue;
    }
    double next[3], plane[3], step[3];
    for (int a = 0; a < 3; ++a) {
      next[a] = kInfinity;
      plane[a] = step[a] = 0;
      if (ray.is_parallel(a)) continue;
      step[a] = ray.direction[a] < 0 ? -1 : 1;
      const double p = ray.at(a, span.begin) - span.corner[a];
      plane[a] = span.corner[a] + (step[a] < 0 ? std::ceil(p) - 1 : std::floor(p) + 1);
      while (ray.plane(a, plane[a] - step[a]) > span.begin) plane[a] -= step[a];
      while ((next[a] = ray.plane(a, plane[a])) <= span.begin) plane[a] += step[a];
    }
    int cut = 0, i = segments.count;
    double t = span.begin;
    while (true) {
      const double next_cut = cut < span.cut_count ? cuts[span.first_cut + cut] : kInfinity;
      const int axis =
          next[0] <= next[1] ? (next[0] <= next[2] ? 0 : 2) : (next[1] <= next[2] ? 1 : 2);
      const double out = std::min(std::min(next[axis], next_cut), span.end);
      put(field, span, t, 0.5 * (t + out), out - t, segments, i++);
      if (out == span.end) break;
      t = out;
      if (next_cut == out) {
        ++cut;
      } else {
        plane[axis] += step[axis];
        next[axis] = ray.plane(axis, plane[axis]);
      }
    }
    segments.count = i;
  }
  pad_to_lanes(segments);
}

// A segment's polynomial around its middle, in floats.
struct Cubic {
  float value, vx, vy, vz, vxy, vxz, vyz, vxyz;
};

inline Cubic cubic_at(const Field& field, const Segments& s, int i) {
  const float* c = field.nodes + s.offset[i];
  constexpr int kY = kNodes, kZ = kNodes * kNodes;
  const float fx = s.fraction[0][i], fy = s.fraction[1][i], fz = s.fraction[2][i];
  const float x00 = c[1] - c[0], x10 = c[kY + 1] - c[kY];
  const float x01 = c[kZ + 1] - c[kZ], x11 = c[kZ + kY + 1] - c[kZ + kY];
  const float v00 = c[0] + fx * x00, v10 = c[kY] + fx * x10;
  const float v01 = c[kZ] + fx * x01, v11 = c[kZ + kY] + fx * x11;
  const float y0 = v10 - v00, y1 = v11 - v01, xy0 = x10 - x00, xy1 = x11 - x01;
  const float v0 = v00 + fy * y0, v1 = v01 + fy * y1;
  const float x0 = x00 + fy * xy0, x1 = x01 + fy * xy1;
  const float z = v1 - v0, xz = x1 - x0, yz = y1 - y0, xyz = xy1 - xy0;
  return {v0 + fz * z, x0 + fz * xz, y0 + fz * yz, z, xy0 + fz * xyz, xz, yz, xyz};
}

struct Direction {
  explicit Direction(const Field& field)
      : x(float(field.ray.direction[0])),
        y(float(field.ray.direction[1])),
        z(float(field.ray.direction[2])),
        scale(field.step_voxels > 0 ? 0.0f : 1.0f) {}
  float x, y, z;
  float scale;  // 0 where `middle` is a Gauss point and stands for its step as it is.
};

inline float mean_of(const Cubic& c, const Direction& d, float length) {
  const float twelfth = length * length * (1.0f / 12);
  const float q = d.x * d.y * c.vxy + d.x * d.z * c.vxz + d.y * d.z * c.vyz;
  // The field is nowhere negative; only rounding is.
  return std::max(c.value + q * twelfth, 0.0f);
}

void evaluate_scalar(const Field& field, Want want, Segments& s) {
  const Direction d(field);
  for (int i = 0; i < s.count; ++i) {
    const Cubic c = cubic_at(field, s, i);
    const float length = float(s.length[i]) * d.scale;
    s.mean[i] = mean_of(c, d, length);
    s.change[i] = length * (d.x * c.vx + d.y * c.vy + d.z * c.vz);
    if (want != Want::Gradients) continue;
    const float k = length * (1.0f / 12), k2 = length * length * (1.0f / 12);
    s.gradient[0][i] = c.vx + d.y * d.z * c.vxyz * k2;
    s.gradient[1][i] = c.vy + d.x * d.z * c.vxyz * k2;
    s.gradient[2][i] = c.vz + d.x * d.y * c.vxyz * k2;
    s.moment[0][i] = (d.y * c.vxy + d.z * c.vxz) * k;
    s.moment[1][i] = (d.x * c.vxy + d.z * c.vyz) * k;
    s.moment[2][i] = (d.x * c.vxz + d.y * c.vyz) * k;
  }
}

double integrate_scalar(const Field& field, const Segments& s) {
  const Direction d(field);
  std::array<double, kLanes> lanes{};
  for (int i = 0; i < s.count; ++i) {
    const float length = float(s.length[i]) * d.scale;
    lanes[i % kLanes] += double(mean_of(cubic_at(field, s, i), d, length)) * s.length[i];
  }
  return sum_lanes(lanes);
}

}  // namespace

void Segments::reserve(std::size_t capacity_in_spans) {
  const std::size_t entries = capacity_in_spans * kMaxSegmentsPerSpan + 2 * kLanes;
  if (entries <= capacity_) return;
  capacity_ = entries;
  constexpr std::size_t kEntryBytes =
      3 * sizeof(double) + sizeof(std::int64_t) + 11 * sizeof(float);
  memory_.resize(entries * kEntryBytes + 15 * kAlignment);
  std::byte* at = memory_.data();
  const auto take = [&]<typename T>(T*& array) {
    at += (kAlignment - reinterpret_cast<std::uintptr_t>(at) % kAlignment) % kAlignment;
    array = reinterpret_cast<T*>(at);
    at += entries * sizeof(T);
  };
  take(begin), take(middle), take(length), take(offset);
  for (auto& f : fraction) take(f);
  take(mean), take(change);
  for (auto& g : gradient) take(g);
  for (auto& m : moment) take(m);
}

void collect_tile(const Span& span, const double* cuts, Segments& s) {
  double t = span.begin;
  for (int c = 0; c <= span.cut_count; ++c) {
    const double out = c < span.cut_count ? cuts[span.first_cut + c] : span.end;
    const int i = s.count++;
    s.begin[i] = t;
    s.middle[i] = 0.5 * (t + out);
    s.length[i] = out - t;
    s.offset[i] = 0;
    for (auto* f : s.fraction) f[i] = 0;
    s.tiles.emplace_back(i, span.tile);
    t = out;
  }
}

void set_tiles(Segments& s) {
  for (const auto& [i, value] : s.tiles) {
    s.mean[i] = value;
    s.change[i] = 0;
    for (int a = 0; a < 3; ++a) s.gradient[a][i] = s.moment[a][i] = 0;
  }
}

void collect_coarse(const Field& field, const Span* spans, int span_count, const double* cuts,
                    Segments& segments) {
  constexpr double kGauss = 0.28867513459481287;  // 1 / sqrt(12), from the middle of a step.
  const double speed = field.ray.speed();
  segments.tiles.clear();
  segments.count = 0;
  for (int n = 0; n < span_count; ++n) {
    const Span& span = spans[n];
    if (span.tile >= 0) {
      collect_tile(span, cuts, segments);
      continue;
    }
    double t = span.begin;
    for (int c = 0; c <= span.cut_count; ++c) {
      const double out = c < span.cut_count ? cuts[span.first_cut + c] : span.end;
      // Rounding must not make one more step of a length that is a whole number of them.
      const int steps = std::max(1, int(std::ceil((out - t) * speed / field.step_voxels - 1e-9)));
      const double h = (out - t) / steps;
      for (int i = 0; i < steps; ++i) {
        const double centre = t + (i + 0.5) * h;
        put(field, span, t + i * h, centre - kGauss * h, 0.5 * h, segments, segments.count);
        put(field, span, centre, centre + kGauss * h, 0.5 * h, segments, segments.count + 1);
        segments.count += 2;
      }
      t = out;
    }
  }
  pad_to_lanes(segments);
}

void pad_to_lanes(Segments& s) {
  const int end = (s.count + kLanes - 1) / kLanes * kLanes;
  for (int i = s.count; i < end; ++i) {
    s.begin[i] = s.middle[i] = s.length[i] = 0;
    s.offset[i] = 0;
    for (auto* f : s.fraction) f[i] = 0;
  }
}

double sum_lanes(const std::array<double, kLanes>& lanes) {
  std::array<double, kLanes> sums = lanes;
  for (int width = kLanes / 2; width > 0; width /= 2)
    for (int i = 0; i < width; ++i) sums[i] += sums[i + width];
  return sums[0];
}

const SegmentKernel& scalar_kernel() {
  static constexpr SegmentKernel kernel{collect_scalar, evaluate_scalar, integrate_scalar};
  return kernel;
}

}  // namespace brume
