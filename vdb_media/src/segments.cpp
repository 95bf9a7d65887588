#include "segments.h"

#include <algorithm>

namespace brume {
namespace {

constexpr std::size_t kAlignment = 64;

void collect_steps(const Field& field, const Span* spans, int span_count, const double* cuts,
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
    locate(field, span, first, segments);
  }
  pad_to_lanes(segments);
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

void collect(const Field& field, const Span* spans, int span_count, const double* cuts,
             Segments& segments) {
  if (field.step_voxels > 0)
    collect_steps(field, spans, span_count, cuts, segments);
  else
    collect_cells(field, spans, span_count, cuts, segments);
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

}  // namespace brume
