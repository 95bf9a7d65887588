#include "segments.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace brume {
namespace {

constexpr int kNodes = BrickGrid::kNodes;
constexpr std::size_t kAlignment = 64;

// Four at a time: two registers of any x86-64 or ARM CPU, and plain arithmetic elsewhere.
constexpr int kFour = 4;
using Four = float __attribute__((vector_size(kFour * sizeof(float))));

using Two = double __attribute__((vector_size(2 * sizeof(double))));

inline Two load_two(const double* from) {
  Two v;
  std::memcpy(&v, from, sizeof v);
  return v;
}

// Four segments around `middle`. Rounding may put one a hair outside the brick, where the nearest
// cell continues the field.
inline void put(const IndexRay& ray, const Span& span, Segments& s, int i) {
  // Added to a small number it rounds it to an integer, which then fills the low bits.
  constexpr double kMagic = 0x1p52;
  constexpr Two kZero{0, 0}, kLast{kNodes - 2, kNodes - 2}, kOne{1, 1};
  for (int l = i; l < i + kFour; l += 2) {
    const Two middle = load_two(s.middle + l);
    Two node = {};
    for (int a = 2; a >= 0; --a) {
      const Two p = ray.origin[a] + ray.direction[a] * middle - span.corner[a];
      const Two above = p > kZero ? p : kZero;
      const Two held = above < kLast ? above : kLast;
      const Two rounded = (held + kMagic) - kMagic;
      const Two cell = rounded - (rounded > held ? kOne : kZero);
      const Two fraction = p - cell;
      s.fraction[a][l] = float(fraction[0]);
      s.fraction[a][l + 1] = float(fraction[1]);
      node = node * double(kNodes) + cell;
    }
    for (int k = 0; k < 2; ++k)
      s.offset[l + k] = span.offset + (std::bit_cast<std::int64_t>(node[k] + kMagic) -
                                       std::bit_cast<std::int64_t>(kMagic));
  }
}

// The crossings of one axis with a brick's planes, ascending, and endless ones after them. Returns
// the first that is past the begin.
inline const double* crossings(const IndexRay& ray, const Span& span, int axis,
                               std::array<double, 9>& t) {
  t[8] = kInfinity;
  if (ray.is_parallel(axis)) return &t[8];
  const double first = span.corner[axis] + (ray.direction[axis] < 0 ? 8 : 0);
  const double step = ray.direction[axis] < 0 ? -1 : 1;
  for (int k = 0; k < 8; ++k) t[k] = ray.plane(axis, first + step * k);
  int before = 0;
  for (int k = 0; k < 8; ++k) before += t[k] <= span.begin;
  return &t[before];
}

void collect_scalar(const Field& field, const Span* spans, int span_count, const double* cuts,
                    Segments& segments) {
  const IndexRay& ray = field.ray;
  segments.tiles.clear();
  int count = 0;
  std::array<double, 9> planes[3];
  std::array<double, kMaxCuts + 1> more;
  for (int n = 0; n < span_count; ++n) {
    const Span& span = spans[n];
    if (span.tile >= 0) {
      segments.count = count;
      collect_tile(span, cuts, segments);
      count = segments.count;
      continue;
    }
    const double* x = crossings(ray, span, 0, planes[0]);
    const double* y = crossings(ray, span, 1, planes[1]);
    const double* z = crossings(ray, span, 2, planes[2]);
    for (int k = 0; k < span.cut_count; ++k) more[k] = cuts[span.first_cut + k];
    more[span.cut_count] = kInfinity;
    const double* c = more.data();
    // Merged without a branch on which is next, for that is anybody's guess.
    double* out = segments.begin + count;
    *out = span.begin;
    while (true) {
      const bool x_first = *x <= *y, z_first = *z <= *c;
      const double xy = std::min(*x, *y), zc = std::min(*z, *c);
      const bool xy_first = xy <= zc;
      const double t = std::min(xy, zc);
      if (!(t < span.end)) break;
      *++out = t;
      x += xy_first & x_first;
      y += xy_first & !x_first;
      z += !xy_first & z_first;
      c += !xy_first & !z_first;
    }
    out[1] = span.end;
    const int end = int(out - segments.begin) + 1;
    for (int i = count; i < end; i += kFour) {
      for (int l = 0; l < kFour; ++l) {
        const double t0 = segments.begin[i + l], t1 = segments.begin[i + l + 1];
        segments.middle[i + l] = 0.5 * (t0 + t1);
        segments.length[i + l] = t1 - t0;
      }
      put(ray, span, segments, i);
    }
    // Nodes are read a dozen spans later, by when they have come.
    for (int i = count; i < end; ++i) {
      __builtin_prefetch(field.nodes + segments.offset[i]);
      __builtin_prefetch(field.nodes + segments.offset[i] + kNodes * kNodes);
    }
    count = end;
  }
  segments.count = count;
  pad_to_lanes(segments);
}

// Polynomials of four segments around their middles.
struct Cubics {
  Four value, vx, vy, vz, vxy, vxz, vyz, vxyz;
};

// Two nodes that are neighbours along x, of four cells.
struct NodePairs {
  Four first, second;
};
inline double load_pair(const float* pair) {
  double bits;
  std::memcpy(&bits, pair, sizeof bits);
  return bits;
}
inline NodePairs load_pairs(const float* nodes, const std::int64_t* offset) {
  const Two low{load_pair(nodes + offset[0]), load_pair(nodes + offset[1])};
  const Two high{load_pair(nodes + offset[2]), load_pair(nodes + offset[3])};
  const Four a = reinterpret_cast<Four>(low), b = reinterpret_cast<Four>(high);
  return {__builtin_shufflevector(a, b, 0, 2, 4, 6), __builtin_shufflevector(a, b, 1, 3, 5, 7)};
}

inline Four load(const float* from) {
  Four v;
  std::memcpy(&v, from, sizeof v);
  return v;
}

inline Cubics cubics_at(const Field& field, const Segments& s, int i) {
  constexpr int kY = kNodes, kZ = kNodes * kNodes;
  const NodePairs c00 = load_pairs(field.nodes, s.offset + i);
  const NodePairs c10 = load_pairs(field.nodes + kY, s.offset + i);
  const NodePairs c01 = load_pairs(field.nodes + kZ, s.offset + i);
  const NodePairs c11 = load_pairs(field.nodes + kZ + kY, s.offset + i);
  const Four fx = load(s.fraction[0] + i), fy = load(s.fraction[1] + i),
             fz = load(s.fraction[2] + i);
  const Four x00 = c00.second - c00.first, x10 = c10.second - c10.first;
  const Four x01 = c01.second - c01.first, x11 = c11.second - c11.first;
  const Four v00 = c00.first + fx * x00, v10 = c10.first + fx * x10;
  const Four v01 = c01.first + fx * x01, v11 = c11.first + fx * x11;
  const Four y0 = v10 - v00, y1 = v11 - v01, xy0 = x10 - x00, xy1 = x11 - x01;
  const Four v0 = v00 + fy * y0, v1 = v01 + fy * y1;
  const Four x0 = x00 + fy * xy0, x1 = x01 + fy * xy1;
  const Four z = v1 - v0, xz = x1 - x0, yz = y1 - y0, xyz = xy1 - xy0;
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

inline Four to_floats(const double* v) {
  return Four{float(v[0]), float(v[1]), float(v[2]), float(v[3])};
}
inline Four lengths(const Direction& d, const double* length) {
  return to_floats(length) * d.scale;
}

inline Four mean_of(const Cubics& c, const Direction& d, Four length) {
  const Four twelfth = length * length * (1.0f / 12);
  const Four q = d.x * d.y * c.vxy + d.x * d.z * c.vxz + d.y * d.z * c.vyz;
  const Four mean = c.value + q * twelfth, zero = {};
  // The field is nowhere negative; only rounding is.
  return mean > zero ? mean : zero;
}

inline void store(float* to, Four v) { std::memcpy(to, &v, sizeof v); }

void evaluate_scalar(const Field& field, Want want, Segments& s) {
  const Direction d(field);
  for (int i = 0; i < s.count; i += kFour) {
    const Cubics c = cubics_at(field, s, i);
    const Four length = lengths(d, s.length + i);
    store(s.mean + i, mean_of(c, d, length));
    store(s.change + i, length * (d.x * c.vx + d.y * c.vy + d.z * c.vz));
    if (want != Want::Gradients) continue;
    const Four k2 = length * length * (1.0f / 12), whole = to_floats(s.length + i);
    const Four middle = to_floats(s.middle + i), k3 = k2 * length;
    const Four gx = (c.vx + d.y * d.z * c.vxyz * k2) * whole;
    const Four gy = (c.vy + d.x * d.z * c.vxyz * k2) * whole;
    const Four gz = (c.vz + d.x * d.y * c.vxyz * k2) * whole;
    store(s.gradient[0] + i, gx);
    store(s.gradient[1] + i, gy);
    store(s.gradient[2] + i, gz);
    store(s.moment[0] + i, middle * gx + (d.y * c.vxy + d.z * c.vxz) * k3);
    store(s.moment[1] + i, middle * gy + (d.x * c.vxy + d.z * c.vyz) * k3);
    store(s.moment[2] + i, middle * gz + (d.x * c.vxz + d.y * c.vyz) * k3);
  }
}

double integrate_scalar(const Field& field, const Segments& s) {
  const Direction d(field);
  std::array<double, kLanes> lanes{};
  for (int i = 0; i < s.count; i += kFour) {
    const Four mean = mean_of(cubics_at(field, s, i), d, lengths(d, s.length + i));
    for (int l = 0; l < kFour; ++l) lanes[i % kLanes + l] += double(mean[l]) * s.length[i + l];
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
    const int first = segments.count;
    double t = span.begin;
    for (int c = 0; c <= span.cut_count; ++c) {
      const double out = c < span.cut_count ? cuts[span.first_cut + c] : span.end;
      // Rounding must not make one more step of a length that is a whole number of them.
      const int steps = std::max(1, int(std::ceil((out - t) * speed / field.step_voxels - 1e-9)));
      const double h = (out - t) / steps;
      for (int i = 0; i < steps; ++i) {
        const double centre = t + (i + 0.5) * h;
        for (const double side : {-1.0, 1.0}) {
          const int at = segments.count++;
          segments.begin[at] = side < 0 ? t + i * h : centre;
          segments.middle[at] = centre + side * kGauss * h;
          segments.length[at] = 0.5 * h;
        }
      }
      t = out;
    }
    for (int i = first; i < segments.count; i += kFour) put(field.ray, span, segments, i);
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
