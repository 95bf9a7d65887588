// The two passes of segments.h, in vectors of whatever width the CPU has: one source for every
// instruction set, chosen when the program runs. No fused operations and no libm, so that all give
// the same bits.
#include "segments.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "segment_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "node_pairs-inl.h"

HWY_BEFORE_NAMESPACE();
namespace brume {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr int kNodes = BrickGrid::kNodes, kRow = 8;

// Doubles, floats in as many bytes, and as many floats as there are doubles.
using D = hn::CappedTag<double, kRow>;
using F = hn::CappedTag<float, kLanes>;
using FewF = hn::Rebind<float, D>;
using I = hn::RebindToSigned<D>;
using VD = hn::Vec<D>;
using VF = hn::Vec<F>;
constexpr D d;
constexpr F f;
constexpr FewF few;
constexpr I di;
constexpr int kDoubles = int(hn::MaxLanes(d)), kFloats = int(hn::MaxLanes(f));
constexpr int kHalves = kFloats / kDoubles;  // Vectors of doubles that hold as many lanes.

// What depends on there being several lanes.
#if HWY_TARGET == HWY_SCALAR
static_assert(kHalves == 1);
template <int kApart>
HWY_INLINE VD order_within(VD v) {
  return v;
}
HWY_INLINE VF to_floats(const double* from) { return hn::DemoteTo(f, hn::LoadU(d, from)); }
HWY_INLINE void to_doubles(VF v, VD* to) { to[0] = hn::PromoteTo(d, v); }
#else
static_assert(kHalves == 2);
// Of each pair of lanes that lie `kApart` from each other, the smaller goes first.
template <int kApart>
HWY_INLINE VD order_within(VD v) {
  if constexpr (kApart == 1) {
    const VD other = hn::Reverse2(d, v);
    return hn::OddEven(hn::Max(v, other), hn::Min(v, other));
  } else if constexpr (2 * kApart == kDoubles) {
    const VD other = hn::ConcatLowerUpper(d, v, v);
    return hn::ConcatUpperLower(d, hn::Max(v, other), hn::Min(v, other));
  } else {
    const VD other = hn::SwapAdjacentBlocks(v);
    return hn::OddEvenBlocks(hn::Max(v, other), hn::Min(v, other));
  }
}
HWY_INLINE VF to_floats(const double* from) {
  return hn::Combine(f, hn::DemoteTo(few, hn::LoadU(d, from + kDoubles)),
                     hn::DemoteTo(few, hn::LoadU(d, from)));
}
HWY_INLINE void to_doubles(VF v, VD* to) {
  to[0] = hn::PromoteTo(d, hn::LowerHalf(few, v));
  to[1] = hn::PromoteTo(d, hn::UpperHalf(few, v));
}
#endif

// Eight numbers.
constexpr int kRegisters = kRow / kDoubles;
struct Row {
  HWY_INLINE Row() {}  // One that the compiler adds would not be of this instruction set.
  VD v[kRegisters];
};

HWY_INLINE Row set_row(double value) {
  Row row;
  for (VD& v : row.v) v = hn::Set(d, value);
  return row;
}
HWY_INLINE void store(const Row& row, double* to) {
  for (int r = 0; r < kRegisters; ++r) hn::StoreU(row.v[r], d, to + r * kDoubles);
}
HWY_INLINE Row min(const Row& a, const Row& b) {
  Row row;
  for (int r = 0; r < kRegisters; ++r) row.v[r] = hn::Min(a.v[r], b.v[r]);
  return row;
}
HWY_INLINE Row max(const Row& a, const Row& b) {
  Row row;
  for (int r = 0; r < kRegisters; ++r) row.v[r] = hn::Max(a.v[r], b.v[r]);
  return row;
}
HWY_INLINE Row reversed(const Row& a) {
  Row row;
  for (int r = 0; r < kRegisters; ++r) row.v[r] = hn::Reverse(d, a.v[kRegisters - 1 - r]);
  return row;
}

// Of each pair of numbers that lie `kApart` from each other, the smaller goes first.
template <int kApart>
HWY_INLINE void order(Row& row) {
  constexpr int kStep = kApart / kDoubles;
  if constexpr (kStep == 0) {
    for (VD& v : row.v) v = order_within<kApart>(v);
  } else {
    for (int r = 0; r < kRegisters; ++r) {
      if (r & kStep) continue;
      const VD a = row.v[r], b = row.v[r + kStep];
      row.v[r] = hn::Min(a, b);
      row.v[r + kStep] = hn::Max(a, b);
    }
  }
}

// Sorts eight numbers that rise and then fall, or fall and then rise.
HWY_INLINE Row sort_bitonic(Row row) {
  order<4>(row);
  order<2>(row);
  order<1>(row);
  return row;
}

struct Pair {
  Row low, high;
};

// Two ascending rows of eight become one of sixteen.
HWY_INLINE Pair merge(const Row& a, const Row& b) {
  const Row r = reversed(b);
  return {sort_bitonic(min(a, r)), sort_bitonic(max(a, r))};
}

// The crossings of one axis with a brick's first eight planes, ascending and held to the span.
struct Crossings {
  HWY_INLINE Crossings() {}
  Row t;
  int before = 0, inside = 0;  // How many are not past the span's begin, and how many within it.
};

HWY_INLINE Crossings crossings(const IndexRay& ray, const Span& span, int axis, VD begin, VD end) {
  Crossings c;
  if (ray.is_parallel(axis)) {
    for (VD& v : c.t.v) v = end;
    return c;
  }
  const bool falls = ray.direction[axis] < 0;
  const VD first = hn::Set(d, span.corner[axis] + (falls ? kRow : 0));
  const VD sign = hn::Set(d, falls ? -1.0 : 1.0);
  const VD origin = hn::Set(d, ray.origin[axis]), inverse = hn::Set(d, ray.inverse[axis]);
  std::size_t before = 0, until_end = 0;
  for (int r = 0; r < kRegisters; ++r) {
    const VD plane = hn::Add(first, hn::Mul(sign, hn::Iota(d, double(r * kDoubles))));
    const VD t = hn::Mul(hn::Sub(plane, origin), inverse);
    before += hn::CountTrue(d, hn::Le(t, begin));
    until_end += hn::CountTrue(d, hn::Lt(t, end));
    c.t.v[r] = hn::Min(hn::Max(t, begin), end);
  }
  c.before = int(before);
  c.inside = int(until_end) - c.before;
  return c;
}

// Where middles lie: their cells' first nodes, and how far within them. Rounding may put one a hair
// outside the brick, where the nearest cell continues the field.
HWY_INLINE void locate(const IndexRay& ray, const Span& span, VD middle, Segments& s, int i) {
  // Added to a small number it rounds it to an integer, which then fills the low bits.
  const VD magic = hn::Set(d, 0x1p52);
  VD node = hn::Zero(d);
  for (int a = 2; a >= 0; --a) {
    const VD p =
        hn::Sub(hn::Add(hn::Set(d, ray.origin[a]), hn::Mul(hn::Set(d, ray.direction[a]), middle)),
                hn::Set(d, span.corner[a]));
    const VD held = hn::Min(hn::Max(p, hn::Zero(d)), hn::Set(d, kNodes - 2));
    const VD cell = hn::Floor(held);
    hn::StoreU(hn::DemoteTo(few, hn::Sub(p, cell)), few, s.fraction[a] + i);
    node = hn::Add(hn::Mul(node, hn::Set(d, kNodes)), cell);
  }
  const auto bits = hn::Sub(hn::BitCast(di, hn::Add(node, magic)), hn::BitCast(di, magic));
  hn::StoreU(hn::Add(bits, hn::Set(di, span.offset)), di, s.offset + i);
}

void Locate(const Field& field, const Span& span, int first, Segments& segments) {
  for (int i = first; i < segments.count; i += kDoubles)
    locate(field.ray, span, hn::LoadU(d, segments.middle + i), segments, i);
}

void Collect(const Field& field, const Span* spans, int span_count, const double* cuts,
             Segments& segments) {
  const IndexRay& ray = field.ray;
  segments.tiles.clear();
  int count = 0;
  // A span's begin, its crossings in order, and its end as often as vectors reach past it.
  constexpr int kEnds = 4 * kRow + 1;
  double ends[kEnds + 2 * kRow];
  for (int n = 0; n < span_count; ++n) {
    const Span& span = spans[n];
    if (span.tile >= 0) {
      segments.count = count;
      collect_tile(span, cuts, segments);
      count = segments.count;
      continue;
    }
    const VD begin = hn::Set(d, span.begin), end = hn::Set(d, span.end);
    const Crossings x = crossings(ray, span, 0, begin, end),
                    y = crossings(ray, span, 1, begin, end),
                    z = crossings(ray, span, 2, begin, end);
    const int before = x.before + y.before + z.before;
    const int inside = x.inside + y.inside + z.inside + span.cut_count;
    ends[0] = span.begin;
    const Pair xy = merge(x.t, y.t);
    if (span.cut_count == 0) {
      // Sixteen and eight: z's upper half would all be at the end and drops out.
      const Row zr = reversed(z.t), middle = min(xy.high, zr);
      store(sort_bitonic(min(xy.low, middle)), ends + 1);
      store(sort_bitonic(max(xy.low, middle)), ends + 1 + kRow);
      store(sort_bitonic(max(xy.high, zr)), ends + 1 + 2 * kRow);
      store(set_row(span.end), ends + 1 + 3 * kRow);
    } else {
      double padded[kRow];
      for (int k = 0; k < kRow; ++k)
        padded[k] = k < span.cut_count ? cuts[span.first_cut + k] : span.end;
      Row c;
      for (int r = 0; r < kRegisters; ++r) c.v[r] = hn::LoadU(d, padded + r * kDoubles);
      const Pair zc = merge(z.t, c);
      const Row r0 = reversed(zc.high), r1 = reversed(zc.low);
      const Row a0 = min(xy.low, r0), a1 = min(xy.high, r1);
      const Row b0 = max(xy.low, r0), b1 = max(xy.high, r1);
      store(sort_bitonic(min(a0, a1)), ends + 1);
      store(sort_bitonic(max(a0, a1)), ends + 1 + kRow);
      store(sort_bitonic(min(b0, b1)), ends + 1 + 2 * kRow);
      store(sort_bitonic(max(b0, b1)), ends + 1 + 3 * kRow);
    }
    store(set_row(span.end), ends + kEnds);
    for (int i = 0; i <= inside; i += kDoubles) {
      const VD t0 = hn::LoadU(d, ends + before + i), t1 = hn::LoadU(d, ends + before + i + 1);
      const VD middle = hn::Mul(hn::Set(d, 0.5), hn::Add(t0, t1));
      hn::StoreU(t0, d, segments.begin + count + i);
      hn::StoreU(middle, d, segments.middle + count + i);
      hn::StoreU(hn::Sub(t1, t0), d, segments.length + count + i);
      locate(ray, span, middle, segments, count + i);
    }
    // Nodes are read a dozen spans later, by when they have come.
    for (int i = count; i <= count + inside; ++i) {
      __builtin_prefetch(field.nodes + segments.offset[i]);
      __builtin_prefetch(field.nodes + segments.offset[i] + kNodes * kNodes);
    }
    count += inside + 1;
  }
  segments.count = count;
  pad_to_lanes(segments);
}

HWY_INLINE VF mul(VF a, VF b) { return hn::Mul(a, b); }
HWY_INLINE VF add(VF a, VF b) { return hn::Add(a, b); }
HWY_INLINE VF sub(VF a, VF b) { return hn::Sub(a, b); }

// Polynomials of segments around their middles.
struct Cubics {
  VF value, vx, vy, vz, vxy, vxz, vyz, vxyz;
};
HWY_INLINE Cubics cubics_at(const Field& field, const Segments& s, int i) {
  constexpr int kY = kNodes, kZ = kNodes * kNodes;
  const auto c00 = node_pairs(f, field.nodes, s.offset + i);
  const auto c10 = node_pairs(f, field.nodes + kY, s.offset + i);
  const auto c01 = node_pairs(f, field.nodes + kZ, s.offset + i);
  const auto c11 = node_pairs(f, field.nodes + kZ + kY, s.offset + i);
  const VF fx = hn::LoadU(f, s.fraction[0] + i), fy = hn::LoadU(f, s.fraction[1] + i),
           fz = hn::LoadU(f, s.fraction[2] + i);
  const VF x00 = sub(c00.second, c00.first), x10 = sub(c10.second, c10.first);
  const VF x01 = sub(c01.second, c01.first), x11 = sub(c11.second, c11.first);
  const VF v00 = add(c00.first, mul(fx, x00)), v10 = add(c10.first, mul(fx, x10));
  const VF v01 = add(c01.first, mul(fx, x01)), v11 = add(c11.first, mul(fx, x11));
  const VF y0 = sub(v10, v00), y1 = sub(v11, v01), xy0 = sub(x10, x00), xy1 = sub(x11, x01);
  const VF v0 = add(v00, mul(fy, y0)), v1 = add(v01, mul(fy, y1));
  const VF x0 = add(x00, mul(fy, xy0)), x1 = add(x01, mul(fy, xy1));
  const VF z = sub(v1, v0), xz = sub(x1, x0), yz = sub(y1, y0), xyz = sub(xy1, xy0);
  return {add(v0, mul(fz, z)),
          add(x0, mul(fz, xz)),
          add(y0, mul(fz, yz)),
          z,
          add(xy0, mul(fz, xyz)),
          xz,
          yz,
          xyz};
}

struct Direction {
  explicit Direction(const Field& field)
      : x(hn::Set(f, float(field.ray.direction[0]))),
        y(hn::Set(f, float(field.ray.direction[1]))),
        z(hn::Set(f, float(field.ray.direction[2]))),
        scale(hn::Set(f, field.step_voxels > 0 ? 0.0f : 1.0f)) {}
  VF x, y, z;
  VF scale;  // 0 where `middle` is a Gauss point and stands for its step as it is.
};

HWY_INLINE VF mean_of(const Cubics& c, const Direction& r, VF length) {
  const VF twelfth = mul(mul(length, length), hn::Set(f, 1.0f / 12));
  const VF q =
      add(add(mul(mul(r.x, r.y), c.vxy), mul(mul(r.x, r.z), c.vxz)), mul(mul(r.y, r.z), c.vyz));
  // The field is nowhere negative; only rounding is.
  return hn::Max(add(c.value, mul(q, twelfth)), hn::Zero(f));
}

void Evaluate(const Field& field, Want want, Segments& s) {
  const Direction r(field);
  const VF twelfth = hn::Set(f, 1.0f / 12);
  for (int i = 0; i < s.count; i += kFloats) {
    const auto put = [&](float* to, VF v) { hn::StoreU(v, f, to + i); };
    const Cubics c = cubics_at(field, s, i);
    const VF whole = to_floats(s.length + i), length = mul(whole, r.scale);
    put(s.mean, mean_of(c, r, length));
    put(s.change, mul(length, add(add(mul(r.x, c.vx), mul(r.y, c.vy)), mul(r.z, c.vz))));
    if (want != Want::Gradients) continue;
    const VF k2 = mul(mul(length, length), twelfth), k3 = mul(k2, length);
    const VF middle = to_floats(s.middle + i);
    const VF gx = mul(add(c.vx, mul(mul(mul(r.y, r.z), c.vxyz), k2)), whole);
    const VF gy = mul(add(c.vy, mul(mul(mul(r.x, r.z), c.vxyz), k2)), whole);
    const VF gz = mul(add(c.vz, mul(mul(mul(r.x, r.y), c.vxyz), k2)), whole);
    put(s.gradient[0], gx);
    put(s.gradient[1], gy);
    put(s.gradient[2], gz);
    put(s.moment[0], add(mul(middle, gx), mul(add(mul(r.y, c.vxy), mul(r.z, c.vxz)), k3)));
    put(s.moment[1], add(mul(middle, gy), mul(add(mul(r.x, c.vxy), mul(r.z, c.vyz)), k3)));
    put(s.moment[2], add(mul(middle, gz), mul(add(mul(r.x, c.vxz), mul(r.y, c.vyz)), k3)));
  }
}

// Sixteen sums, whatever the width, added to one in a fixed order.
double Integrate(const Field& field, const Segments& s) {
  const Direction r(field);
  constexpr int kSums = kLanes / kDoubles;
  VD sums[kSums];
  for (VD& sum : sums) sum = hn::Zero(d);
  for (int i = 0; i < s.count; i += kLanes)
    for (int k = 0; k < kSums; k += kHalves) {
      const int at = i + k * kDoubles;
      VD mean[kHalves];
      to_doubles(mean_of(cubics_at(field, s, at), r, mul(to_floats(s.length + at), r.scale)), mean);
      for (int h = 0; h < kHalves; ++h)
        sums[k + h] =
            hn::Add(sums[k + h], hn::Mul(mean[h], hn::LoadU(d, s.length + at + h * kDoubles)));
    }
  std::array<double, kLanes> lanes;
  for (int k = 0; k < kSums; ++k) hn::StoreU(sums[k], d, lanes.data() + k * kDoubles);
  return sum_lanes(lanes);
}

}  // namespace HWY_NAMESPACE
}  // namespace brume
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace brume {

HWY_EXPORT(Locate);
HWY_EXPORT(Collect);
HWY_EXPORT(Evaluate);
HWY_EXPORT(Integrate);

void locate(const Field& field, const Span& span, int first, Segments& segments) {
  HWY_DYNAMIC_DISPATCH(Locate)(field, span, first, segments);
}
void collect_cells(const Field& field, const Span* spans, int span_count, const double* cuts,
                   Segments& segments) {
  HWY_DYNAMIC_DISPATCH(Collect)(field, spans, span_count, cuts, segments);
}
void evaluate(const Field& field, Want want, Segments& segments) {
  HWY_DYNAMIC_DISPATCH(Evaluate)(field, want, segments);
}
double integrate(const Field& field, const Segments& segments) {
  return HWY_DYNAMIC_DISPATCH(Integrate)(field, segments);
}

}  // namespace brume
#endif
