// The kernels of segments.h with 512-bit vectors. The target is set below for this file's functions
// alone: compiling the whole file for it would let its copies of inline functions reach other CPUs.
#include <immintrin.h>

#include "segments.h"

// GCC 12 warns of its own header's way to leave a register undefined (its bug 105593).
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Wuninitialized"

#pragma GCC push_options
#pragma GCC target("avx512f,avx512dq,avx512vl")

namespace brume {
namespace {

constexpr int kNodes = BrickGrid::kNodes;

// Sorts eight numbers that rise and then fall, or fall and then rise.
inline __m512d sort_bitonic(__m512d v) {
  __m512d p = _mm512_shuffle_f64x2(v, v, _MM_SHUFFLE(1, 0, 3, 2));
  v = _mm512_mask_max_pd(_mm512_min_pd(v, p), 0xF0, v, p);
  p = _mm512_permutex_pd(v, _MM_SHUFFLE(1, 0, 3, 2));
  v = _mm512_mask_max_pd(_mm512_min_pd(v, p), 0xCC, v, p);
  p = _mm512_permute_pd(v, 0x55);
  return _mm512_mask_max_pd(_mm512_min_pd(v, p), 0xAA, v, p);
}

inline __m512d reversed(__m512d v) {
  return _mm512_permutexvar_pd(_mm512_set_epi64(0, 1, 2, 3, 4, 5, 6, 7), v);
}

struct Pair {
  __m512d low, high;
};

// Two ascending rows of eight become one of sixteen.
inline Pair merge(__m512d a, __m512d b) {
  b = reversed(b);
  return {sort_bitonic(_mm512_min_pd(a, b)), sort_bitonic(_mm512_max_pd(a, b))};
}

// The crossings of one axis with a brick's first eight planes that lie inside a span: ascending,
// and `end` after the last of them.
struct Crossings {
  __m512d t;
  int count;
};

inline Crossings crossings(const IndexRay& ray, const Span& span, int axis, __m512d end) {
  if (ray.is_parallel(axis)) return {end, 0};
  const __m512d up = _mm512_set_pd(7, 6, 5, 4, 3, 2, 1, 0);
  const __m512d down = _mm512_set_pd(1, 2, 3, 4, 5, 6, 7, 8);
  const __m512d plane =
      _mm512_add_pd(_mm512_set1_pd(span.corner[axis]), ray.direction[axis] < 0 ? down : up);
  const __m512d t = _mm512_mul_pd(_mm512_sub_pd(plane, _mm512_set1_pd(ray.origin[axis])),
                                  _mm512_set1_pd(ray.inverse[axis]));
  const __mmask8 inside = _mm512_mask_cmp_pd_mask(
      _mm512_cmp_pd_mask(t, _mm512_set1_pd(span.begin), _CMP_GT_OQ), t, end, _CMP_LT_OQ);
  return {_mm512_mask_compress_pd(end, inside, t), __builtin_popcount(inside)};
}

// Eight segments from their ends.
inline void put(const IndexRay& ray, const Span& span, __m512d t0, __m512d t1, Segments& s, int i) {
  const __m512d middle = _mm512_mul_pd(_mm512_set1_pd(0.5), _mm512_add_pd(t0, t1));
  _mm512_storeu_pd(s.begin + i, t0);
  _mm512_storeu_pd(s.middle + i, middle);
  _mm512_storeu_pd(s.length + i, _mm512_sub_pd(t1, t0));
  __m512d cell[3];
  for (int a = 0; a < 3; ++a) {
    const __m512d p =
        _mm512_sub_pd(_mm512_add_pd(_mm512_set1_pd(ray.origin[a]),
                                    _mm512_mul_pd(_mm512_set1_pd(ray.direction[a]), middle)),
                      _mm512_set1_pd(span.corner[a]));
    const __m512d held =
        _mm512_min_pd(_mm512_max_pd(p, _mm512_setzero_pd()), _mm512_set1_pd(kNodes - 2));
    cell[a] = _mm512_roundscale_pd(held, _MM_FROUND_TO_ZERO | _MM_FROUND_NO_EXC);
    _mm256_storeu_ps(s.fraction[a] + i, _mm512_cvtpd_ps(_mm512_sub_pd(p, cell[a])));
  }
  const __m512d node =
      _mm512_add_pd(_mm512_add_pd(cell[0], _mm512_mul_pd(cell[1], _mm512_set1_pd(kNodes))),
                    _mm512_mul_pd(cell[2], _mm512_set1_pd(kNodes * kNodes)));
  _mm512_storeu_si512(s.offset + i,
                      _mm512_add_epi64(_mm512_set1_epi64(span.offset), _mm512_cvttpd_epi64(node)));
}

// The row before `v`, moved up by one to end with v's first seven.
inline __m512d shifted(__m512d before, __m512d v) {
  return _mm512_castsi512_pd(
      _mm512_alignr_epi64(_mm512_castpd_si512(v), _mm512_castpd_si512(before), 7));
}

void collect_avx512(const Field& field, const Span* spans, int span_count, const double* cuts,
                    Segments& segments) {
  const IndexRay& ray = field.ray;
  segments.tiles.clear();
  int count = 0;
  for (int n = 0; n < span_count; ++n) {
    const Span& span = spans[n];
    if (span.tile >= 0) {
      segments.count = count;
      collect_tile(span, cuts, segments);
      count = segments.count;
      continue;
    }
    // All that is inside, sorted, in four rows; `end` after it.
    const __m512d begin = _mm512_set1_pd(span.begin), end = _mm512_set1_pd(span.end);
    const Crossings x = crossings(ray, span, 0, end), y = crossings(ray, span, 1, end),
                    z = crossings(ray, span, 2, end);
    int inside = x.count + y.count + z.count;
    const Pair xy = merge(x.t, y.t);
    __m512d t0, t1, t2, t3;
    if (span.cut_count == 0) {
      // Sixteen and eight: z's upper half would all be at the end and drops out.
      const __m512d zr = reversed(z.t);
      const __m512d middle = _mm512_min_pd(xy.high, zr);
      t0 = sort_bitonic(_mm512_min_pd(xy.low, middle));
      t1 = sort_bitonic(_mm512_max_pd(xy.low, middle));
      t2 = sort_bitonic(_mm512_max_pd(xy.high, zr));
      t3 = end;
    } else {
      const __mmask8 used = __mmask8((1u << span.cut_count) - 1);
      const __m512d c = _mm512_mask_loadu_pd(end, used, cuts + span.first_cut);
      inside += span.cut_count;
      const Pair zc = merge(z.t, c);
      const __m512d r0 = reversed(zc.high), r1 = reversed(zc.low);
      const __m512d a0 = _mm512_min_pd(xy.low, r0), a1 = _mm512_min_pd(xy.high, r1);
      const __m512d b0 = _mm512_max_pd(xy.low, r0), b1 = _mm512_max_pd(xy.high, r1);
      t0 = sort_bitonic(_mm512_min_pd(a0, a1));
      t1 = sort_bitonic(_mm512_max_pd(a0, a1));
      t2 = sort_bitonic(_mm512_min_pd(b0, b1));
      t3 = sort_bitonic(_mm512_max_pd(b0, b1));
    }
    // Most spans have up to sixteen segments: a branch between eight and sixteen would cost more.
    put(ray, span, shifted(begin, t0), t0, segments, count);
    put(ray, span, shifted(t0, t1), t1, segments, count + 8);
    if (inside >= 16) {
      put(ray, span, shifted(t1, t2), t2, segments, count + 16);
      put(ray, span, shifted(t2, t3), t3, segments, count + 24);
    }
    // Nodes are read a dozen spans later, by when they have come.
    for (int i = count; i <= count + inside; ++i) {
      const char* cell = reinterpret_cast<const char*>(field.nodes + segments.offset[i]);
      _mm_prefetch(cell, _MM_HINT_T0);
      _mm_prefetch(cell + sizeof(float) * kNodes * kNodes, _MM_HINT_T0);
    }
    count += inside + 1;
  }
  segments.count = count;
  pad_to_lanes(segments);
}

struct Cubics {
  __m512 value, vx, vy, vz, vxy, vxz, vyz, vxyz;
};

inline __m512 mul(__m512 a, __m512 b) { return _mm512_mul_ps(a, b); }
inline __m512 add(__m512 a, __m512 b) { return _mm512_add_ps(a, b); }
inline __m512 sub(__m512 a, __m512 b) { return _mm512_sub_ps(a, b); }

// Two nodes that are neighbours along x, of sixteen cells: as one 64-bit load a cell.
struct NodePairs {
  __m512 first, second;
};
inline NodePairs gather_pairs(const float* nodes, __m512i low, __m512i high) {
  const __m512 a = _mm512_castpd_ps(_mm512_i64gather_pd(low, nodes, 4));
  const __m512 b = _mm512_castpd_ps(_mm512_i64gather_pd(high, nodes, 4));
  const __m512i even = _mm512_set_epi32(30, 28, 26, 24, 22, 20, 18, 16, 14, 12, 10, 8, 6, 4, 2, 0);
  const __m512i odd = _mm512_set_epi32(31, 29, 27, 25, 23, 21, 19, 17, 15, 13, 11, 9, 7, 5, 3, 1);
  return {_mm512_permutex2var_ps(a, even, b), _mm512_permutex2var_ps(a, odd, b)};
}

inline Cubics cubics_at(const Field& field, const Segments& s, int i) {
  const __m512i low = _mm512_load_si512(s.offset + i), high = _mm512_load_si512(s.offset + i + 8);
  constexpr int kY = kNodes, kZ = kNodes * kNodes;
  const NodePairs c00 = gather_pairs(field.nodes, low, high);
  const NodePairs c10 = gather_pairs(field.nodes + kY, low, high);
  const NodePairs c01 = gather_pairs(field.nodes + kZ, low, high);
  const NodePairs c11 = gather_pairs(field.nodes + kZ + kY, low, high);
  const __m512 fx = _mm512_load_ps(s.fraction[0] + i), fy = _mm512_load_ps(s.fraction[1] + i),
               fz = _mm512_load_ps(s.fraction[2] + i);
  const __m512 x00 = sub(c00.second, c00.first), x10 = sub(c10.second, c10.first);
  const __m512 x01 = sub(c01.second, c01.first), x11 = sub(c11.second, c11.first);
  const __m512 v00 = add(c00.first, mul(fx, x00)), v10 = add(c10.first, mul(fx, x10));
  const __m512 v01 = add(c01.first, mul(fx, x01)), v11 = add(c11.first, mul(fx, x11));
  const __m512 y0 = sub(v10, v00), y1 = sub(v11, v01), xy0 = sub(x10, x00), xy1 = sub(x11, x01);
  const __m512 v0 = add(v00, mul(fy, y0)), v1 = add(v01, mul(fy, y1));
  const __m512 x0 = add(x00, mul(fy, xy0)), x1 = add(x01, mul(fy, xy1));
  const __m512 z = sub(v1, v0), xz = sub(x1, x0), yz = sub(y1, y0), xyz = sub(xy1, xy0);
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
      : x(_mm512_set1_ps(float(field.ray.direction[0]))),
        y(_mm512_set1_ps(float(field.ray.direction[1]))),
        z(_mm512_set1_ps(float(field.ray.direction[2]))),
        scale(_mm512_set1_ps(field.step_voxels > 0 ? 0.0f : 1.0f)) {}
  __m512 x, y, z, scale;
};

inline __m512 to_floats(__m512d low, __m512d high) {
  return _mm512_insertf32x8(_mm512_castps256_ps512(_mm512_cvtpd_ps(low)), _mm512_cvtpd_ps(high), 1);
}
inline __m512 to_floats(const double* v) {
  return to_floats(_mm512_load_pd(v), _mm512_load_pd(v + 8));
}
inline __m512 lengths(const Direction& d, __m512d low, __m512d high) {
  return mul(to_floats(low, high), d.scale);
}

inline __m512 mean_of(const Cubics& c, const Direction& d, __m512 length) {
  const __m512 twelfth = mul(mul(length, length), _mm512_set1_ps(1.0f / 12));
  const __m512 q =
      add(add(mul(mul(d.x, d.y), c.vxy), mul(mul(d.x, d.z), c.vxz)), mul(mul(d.y, d.z), c.vyz));
  return _mm512_max_ps(add(c.value, mul(q, twelfth)), _mm512_setzero_ps());
}

void evaluate_avx512(const Field& field, Want want, Segments& s) {
  const Direction d(field);
  const __m512 twelfth = _mm512_set1_ps(1.0f / 12);
  for (int i = 0; i < s.count; i += kLanes) {
    const Cubics c = cubics_at(field, s, i);
    const __m512 length =
        lengths(d, _mm512_load_pd(s.length + i), _mm512_load_pd(s.length + i + 8));
    _mm512_store_ps(s.mean + i, mean_of(c, d, length));
    _mm512_store_ps(s.change + i,
                    mul(length, add(add(mul(d.x, c.vx), mul(d.y, c.vy)), mul(d.z, c.vz))));
    if (want != Want::Gradients) continue;
    const __m512 k2 = mul(mul(length, length), twelfth), k3 = mul(k2, length);
    const __m512 whole = to_floats(s.length + i), middle = to_floats(s.middle + i);
    const __m512 gx = mul(add(c.vx, mul(mul(mul(d.y, d.z), c.vxyz), k2)), whole);
    const __m512 gy = mul(add(c.vy, mul(mul(mul(d.x, d.z), c.vxyz), k2)), whole);
    const __m512 gz = mul(add(c.vz, mul(mul(mul(d.x, d.y), c.vxyz), k2)), whole);
    _mm512_store_ps(s.gradient[0] + i, gx);
    _mm512_store_ps(s.gradient[1] + i, gy);
    _mm512_store_ps(s.gradient[2] + i, gz);
    _mm512_store_ps(s.moment[0] + i,
                    add(mul(middle, gx), mul(add(mul(d.y, c.vxy), mul(d.z, c.vxz)), k3)));
    _mm512_store_ps(s.moment[1] + i,
                    add(mul(middle, gy), mul(add(mul(d.x, c.vxy), mul(d.z, c.vyz)), k3)));
    _mm512_store_ps(s.moment[2] + i,
                    add(mul(middle, gz), mul(add(mul(d.x, c.vxz), mul(d.y, c.vyz)), k3)));
  }
}

double integrate_avx512(const Field& field, const Segments& s) {
  const Direction d(field);
  __m512d sum_low = _mm512_setzero_pd(), sum_high = sum_low;
  for (int i = 0; i < s.count; i += kLanes) {
    const __m512d low = _mm512_load_pd(s.length + i), high = _mm512_load_pd(s.length + i + 8);
    const __m512 mean = mean_of(cubics_at(field, s, i), d, lengths(d, low, high));
    sum_low =
        _mm512_add_pd(sum_low, _mm512_mul_pd(_mm512_cvtps_pd(_mm512_castps512_ps256(mean)), low));
    sum_high = _mm512_add_pd(sum_high,
                             _mm512_mul_pd(_mm512_cvtps_pd(_mm512_extractf32x8_ps(mean, 1)), high));
  }
  alignas(64) std::array<double, kLanes> lanes;
  _mm512_store_pd(lanes.data(), sum_low);
  _mm512_store_pd(lanes.data() + 8, sum_high);
  return sum_lanes(lanes);
}

constexpr SegmentKernel kKernel{collect_avx512, evaluate_avx512, integrate_avx512};

}  // namespace
}  // namespace brume

#pragma GCC pop_options

namespace brume {

const SegmentKernel* avx512_kernel() {
  static const bool supported = __builtin_cpu_supports("avx512f") &&
                                __builtin_cpu_supports("avx512dq") &&
                                __builtin_cpu_supports("avx512vl");
  return supported ? &kKernel : nullptr;
}

}  // namespace brume
