#include "cone_kernel.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cone_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "node_pairs-inl.h"

#include "vdb_media/brick_grid.h"

HWY_BEFORE_NAMESPACE();
namespace brume {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kConeLanes>;
using F = hn::Vec<D>;
using DI = hn::RebindToSigned<D>;
using I = hn::Vec<DI>;
constexpr D d;
constexpr DI di;

HWY_INLINE F set(float v) { return hn::Set(d, v); }
HWY_INLINE F add(F a, F b) { return hn::Add(a, b); }
HWY_INLINE F sub(F a, F b) { return hn::Sub(a, b); }
HWY_INLINE F mul(F a, F b) { return hn::Mul(a, b); }
HWY_INLINE F blend(F a, F b, F t) { return add(a, mul(t, sub(b, a))); }

// Of x in [-126 ln 2, 0]; good to 2e-7 of itself.
HWY_INLINE F exp_of(F x) {
  const F held = hn::Max(x, set(-87.0f));
  const F n = hn::Round(mul(held, set(1.44269504f)));
  const F r = sub(sub(held, mul(n, set(0.693359375f))), mul(n, set(-2.12194440e-4f)));
  F p = set(1.0f / 720);
  p = add(mul(p, r), set(1.0f / 120));
  p = add(mul(p, r), set(1.0f / 24));
  p = add(mul(p, r), set(1.0f / 6));
  p = add(mul(p, r), set(0.5f));
  p = add(mul(p, r), set(1.0f));
  p = add(mul(p, r), set(1.0f));
  const I power = hn::ShiftLeft<23>(hn::Add(hn::ConvertTo(di, n), hn::Set(di, 127)));
  return mul(p, hn::BitCast(d, power));
}

// Of x in (0, 1]: the logarithm of the mantissa by atanh, whose series is short near 1.
HWY_INLINE F log_of(F x) {
  const I bits = hn::BitCast(di, x);
  // So that the mantissa lies around 1.
  const I exponent = hn::ShiftRight<23>(hn::Sub(bits, hn::Set(di, 0x3f3504f3)));
  const F m = hn::BitCast(d, hn::Sub(bits, hn::ShiftLeft<23>(exponent)));
  const F s = hn::Div(sub(m, set(1.0f)), add(m, set(1.0f))), s2 = mul(s, s);
  F p = set(2.0f / 9);
  p = add(mul(p, s2), set(2.0f / 7));
  p = add(mul(p, s2), set(2.0f / 5));
  p = add(mul(p, s2), set(2.0f / 3));
  p = add(mul(p, s2), set(2.0f));
  return add(mul(hn::ConvertTo(d, exponent), set(0.693147181f)), mul(p, s));
}

// (1 - exp(-x)) / x from x >= 0 and e = exp(-x).
HWY_INLINE F mean_of_exp(F x, F e) {
  const F series = sub(set(1.0f), mul(x, sub(set(0.5f), mul(x, set(1.0f / 6)))));
  const F large = hn::Div(sub(set(1.0f), e), hn::Max(x, set(1e-3f)));
  return hn::IfThenElse(hn::Lt(x, set(0.01f)), series, large);
}

// The part of a depth x that lies before a place drawn in proportion to transmittance.
HWY_INLINE F depth_fraction(F u, F x) {
  const F thick = hn::Max(x, set(1e-3f));
  const F left = sub(set(1.0f), mul(u, sub(set(1.0f), exp_of(hn::Neg(thick)))));
  const F drawn = hn::Min(hn::Div(hn::Neg(log_of(hn::Max(left, set(1e-30f)))), thick), set(1.0f));
  // Its first terms, where the logarithm loses digits.
  const F v = mul(u, sub(set(1.0f), u));
  const F skew = mul(v, sub(set(1.0f), add(u, u)));
  const F series = sub(u, mul(x, sub(mul(v, set(0.5f)), mul(x, mul(skew, set(1.0f / 6))))));
  return hn::IfThenElse(hn::Lt(x, set(0.1f)), series, drawn);
}

HWY_INLINE F fraction_of(F x) { return sub(x, hn::Floor(x)); }

struct Sample {
  F value, x, y, z;  // The density and its derivatives along the level's voxels.
};

template <bool kGradients>
HWY_INLINE Sample sample(const ConeLevel& level, F px, F py, F pz, hn::Mask<D> wanted) {
  constexpr int kNodes = BrickGrid::kNodes, kShift = 3, kLast = BrickGrid::kCells - 1;
  const F zero = hn::Zero(d);
  const auto inside = [&](F p, int bricks) {
    return hn::And(hn::Ge(p, zero), hn::Lt(p, set(float(bricks * BrickGrid::kCells))));
  };
  wanted =
      hn::And(wanted, hn::And(inside(px, level.bricks[0]),
                              hn::And(inside(py, level.bricks[1]), inside(pz, level.bricks[2]))));
  if (hn::AllFalse(d, wanted)) return {zero, zero, zero, zero};
  px = hn::IfThenElseZero(wanted, px);
  py = hn::IfThenElseZero(wanted, py);
  pz = hn::IfThenElseZero(wanted, pz);
  // Truncation is the floor, for none is below 0.
  const I cx = hn::ConvertTo(di, px), cy = hn::ConvertTo(di, py), cz = hn::ConvertTo(di, pz);
  const F fx = sub(px, hn::ConvertTo(d, cx)), fy = sub(py, hn::ConvertTo(d, cy)),
          fz = sub(pz, hn::ConvertTo(d, cz));
  const I row = hn::Add(hn::Mul(hn::ShiftRight<kShift>(cz), hn::Set(di, level.bricks[1])),
                        hn::ShiftRight<kShift>(cy));
  const I brick = hn::Add(hn::Mul(row, hn::Set(di, level.bricks[0])), hn::ShiftRight<kShift>(cx));
  const I entry = hn::GatherIndex(di, level.top, brick);
  const auto is_brick =
      hn::And(wanted, hn::RebindMask(d, hn::Gt(entry, hn::Set(di, BrickGrid::kEmpty))));
  F constant = zero;
  const auto is_tile =
      hn::And(wanted, hn::RebindMask(d, hn::Lt(entry, hn::Set(di, BrickGrid::kEmpty))));
  if (!hn::AllFalse(d, is_tile)) {
    const I tile = hn::IfThenElseZero(hn::RebindMask(di, is_tile), hn::Sub(hn::Set(di, -2), entry));
    constant = hn::IfThenElseZero(is_tile, hn::GatherIndex(d, level.tiles, tile));
  }
  if (hn::AllFalse(d, is_brick)) return {constant, zero, zero, zero};
  const I last = hn::Set(di, kLast), nodes = hn::Set(di, kNodes);
  const I local =
      hn::Add(hn::Mul(hn::Add(hn::Mul(hn::And(cz, last), nodes), hn::And(cy, last)), nodes),
              hn::And(cx, last));
  const I first =
      hn::IfThenElseZero(hn::RebindMask(di, is_brick),
                         hn::Add(hn::Mul(entry, hn::Set(di, BrickGrid::kBrickFloats)), local));
  alignas(64) std::int32_t firsts[kConeLanes];
  hn::Store(first, di, firsts);
  constexpr int kY = kNodes, kZ = kNodes * kNodes;
  const auto [c000, c100] = node_pairs(d, level.nodes, firsts);
  const auto [c010, c110] = node_pairs(d, level.nodes + kY, firsts);
  const auto [c001, c101] = node_pairs(d, level.nodes + kZ, firsts);
  const auto [c011, c111] = node_pairs(d, level.nodes + kZ + kY, firsts);
  const F x00 = sub(c100, c000), x10 = sub(c110, c010), x01 = sub(c101, c001),
          x11 = sub(c111, c011);
  const F v00 = add(c000, mul(fx, x00)), v10 = add(c010, mul(fx, x10));
  const F v01 = add(c001, mul(fx, x01)), v11 = add(c011, mul(fx, x11));
  const F y0 = sub(v10, v00), y1 = sub(v11, v01);
  const F v0 = add(v00, mul(fy, y0)), v1 = add(v01, mul(fy, y1));
  const F value = hn::IfThenElse(is_brick, add(v0, mul(fz, sub(v1, v0))), constant);
  if (!kGradients) return {value, zero, zero, zero};
  return {value, hn::IfThenElseZero(is_brick, blend(blend(x00, x10, fy), blend(x01, x11, fy), fz)),
          hn::IfThenElseZero(is_brick, blend(y0, y1, fz)),
          hn::IfThenElseZero(is_brick, sub(v1, v0))};
}

template <bool kGradients>
void march_lanes(const ConeTrack& track, const ConePacket& packet, const ConeDensity& density,
                 std::size_t lane) {
  const auto load = [&](const ConeLane& v) { return hn::LoadU(d, v.data() + lane); };
  const F zero = hn::Zero(d);
  const F ox = load(packet.origin[0]), oy = load(packet.origin[1]), oz = load(packet.origin[2]);
  const F dx = load(packet.direction[0]), dy = load(packet.direction[1]),
          dz = load(packet.direction[2]);
  const F begin = load(packet.begin), place = load(packet.place), choice = load(packet.choice);
  F end = load(packet.end), whole = zero;
  F ix = zero, iy = zero, iz = zero, mx = zero, my = zero, mz = zero;
  std::size_t k = 0, at = lane;
  const auto store_running = [&] {
    if (!kGradients) return;
    hn::StoreU(ix, d, density.gradient[0] + at), hn::StoreU(iy, d, density.gradient[1] + at);
    hn::StoreU(iz, d, density.gradient[2] + at), hn::StoreU(mx, d, density.moment[0] + at);
    hn::StoreU(my, d, density.moment[1] + at), hn::StoreU(mz, d, density.moment[2] + at);
  };
  for (std::size_t s = 0; s < track.shell_ends.size(); ++s, at += kConeLanes) {
    store_running();
    const std::size_t first = k, past = static_cast<std::size_t>(track.shell_ends[s]);
    F sum = zero, chosen = zero, target = zero;
    // Two rounds where a shell has several steps: how much there is, and which of them stands for
    // it.
    for (int round = 0; round < 2; ++round) {
      F running = zero;
      for (k = first; k < past; ++k) {
        const ConeStep& step = track.steps[k];
        const F low = hn::Max(set(step.begin), begin), high = hn::Min(set(step.end), end);
        const auto is_met = hn::Lt(low, high);
        if (hn::AllFalse(d, is_met)) {
          // Nor are later ones where this one lies behind all ends.
          if (hn::AllFalse(d, hn::Lt(set(step.begin), end))) k = past - 1;
          continue;
        }
        const F length = sub(high, low);
        const F t = add(low, mul(fraction_of(add(set(step.shift), place)), length));
        const ConeLevel& level = track.levels[static_cast<std::size_t>(step.level)];
        const auto at_level = [&](F o, F direction, std::size_t a) {
          const F p = add(o, mul(direction, t));
          return add(mul(p, set(level.scale)), set(level.offset[a]));
        };
        const Sample v = sample<kGradients>(level, at_level(ox, dx, 0), at_level(oy, dy, 1),
                                            at_level(oz, dz, 2), is_met);
        const F part = mul(v.value, length);
        if (round == 0) {
          sum = add(sum, part);
          chosen = t;
          if (!kGradients) continue;
          const F weight = mul(length, set(level.scale)), farther = mul(weight, t);
          ix = add(ix, mul(v.x, weight)), mx = add(mx, mul(v.x, farther));
          iy = add(iy, mul(v.y, weight)), my = add(my, mul(v.y, farther));
          iz = add(iz, mul(v.z, weight)), mz = add(mz, mul(v.z, farther));
          continue;
        }
        // The last that begins before the target.
        chosen = hn::IfThenElse(hn::And(is_met, hn::Le(running, target)), t, chosen);
        running = add(running, part);
      }
      if (past - first == 1 || !track.samples) break;
      const F u = fraction_of(add(set(track.shifts[s]), choice));
      target = mul(sum, depth_fraction(u, mul(sum, set(track.mean_sigma_t))));
    }
    whole = add(whole, sum);
    end = hn::IfThenElse(hn::Lt(whole, set(track.enough)), end, zero);
    hn::StoreU(sum, d, density.integral + at);
    hn::StoreU(chosen, d, density.sample + at);
  }
  store_running();
}

// A constant density of 1.
void march_even_lanes(const ConeTrack& track, const ConePacket& packet, const ConeDensity& density,
                      std::size_t lane) {
  const F begin = hn::LoadU(d, packet.begin.data() + lane);
  const F end = hn::LoadU(d, packet.end.data() + lane);
  const F choice = hn::LoadU(d, packet.choice.data() + lane), zero = hn::Zero(d);
  std::size_t at = lane;
  for (std::size_t s = 0; s < track.steps.size(); ++s, at += kConeLanes) {
    const F low = hn::Max(set(track.steps[s].begin), begin);
    const F length = hn::Max(sub(hn::Min(set(track.steps[s].end), end), low), zero);
    const F u = fraction_of(add(set(track.shifts[s]), choice));
    hn::StoreU(length, d, density.integral + at);
    hn::StoreU(add(low, mul(length, depth_fraction(u, mul(length, set(track.mean_sigma_t))))), d,
               density.sample + at);
  }
}

void March(const ConeTrack& track, const ConePacket& packet, const ConeDensity& density) {
  for (std::size_t lane = 0; lane < kConeLanes; lane += hn::Lanes(d)) {
    if (track.levels.empty())
      march_even_lanes(track, packet, density, lane);
    else if (density.gradient[0])
      march_lanes<true>(track, packet, density, lane);
    else
      march_lanes<false>(track, packet, density, lane);
  }
}

void Dim(int shells, const float* depths, float* of_shell, float* of_end) {
  for (std::size_t lane = 0; lane < kConeLanes; lane += hn::Lanes(d)) {
    F left = set(1.0f);
    std::size_t at = lane;
    for (int s = 0; s < shells; ++s, at += kConeLanes) {
      const F x = hn::LoadU(d, depths + at), e = exp_of(hn::Neg(x));
      hn::StoreU(mul(left, mean_of_exp(x, e)), d, of_shell + at);
      left = mul(left, e);
    }
    hn::StoreU(left, d, of_end + lane);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace brume
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace brume {

ConeLevel cone_level(const BrickPyramid& pyramid, int level) {
  const BrickGrid& grid = pyramid.level(level);
  ConeLevel of;
  if (grid.is_empty()) return of;
  of.top = grid.top_entries();
  of.tiles = grid.tiles();
  of.nodes = grid.stored_brick_count() > 0 ? grid.brick(0) : nullptr;
  const double scale = 1.0 / (1 << level);
  of.scale = static_cast<float>(scale);
  for (int a = 0; a < 3; ++a) {
    const auto i = static_cast<std::size_t>(a);
    of.bricks[i] = grid.brick_count()[a];
    of.offset[i] = static_cast<float>(
        BrickGrid::kCells * (pyramid.level(0).brick_min()[a] * scale - grid.brick_min()[a]));
  }
  return of;
}

bool is_countable(std::int64_t bricks, std::int64_t positions) {
  constexpr std::int64_t kMost = std::numeric_limits<std::int32_t>::max();
  return bricks <= kMost / BrickGrid::kBrickFloats && positions <= kMost;
}

int cone_level_for(const BrickPyramid& pyramid, double width) {
  const auto fits = [&](int level) {
    const BrickGrid& grid = pyramid.level(level);
    std::int64_t positions = 1;
    for (int a = 0; a < 3; ++a) positions *= grid.brick_count()[a];
    return is_countable(static_cast<std::int64_t>(grid.stored_brick_count()), positions);
  };
  int level = pyramid.level_for(width);
  while (level + 1 < pyramid.level_count() && !fits(level)) ++level;
  return level;
}

HWY_EXPORT(March);
HWY_EXPORT(Dim);

void march_cones(const ConeTrack& track, const ConePacket& packet, const ConeDensity& density) {
  HWY_DYNAMIC_DISPATCH(March)(track, packet, density);
}
void dim_cones(int shells, const float* depths, float* of_shell, float* of_end) {
  HWY_DYNAMIC_DISPATCH(Dim)(shells, depths, of_shell, of_end);
}

}  // namespace brume
#endif
