#include "cache/irradiance_cache.h"

#include <algorithm>

namespace brume {
namespace {

constexpr double kGradientsEnd = 8;

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

// A query as records see it.
struct LocalQuery {
  Vec3d position;  // Relative to the cache's origin; subtracted in double.
  Vec3d normal;
  double min_radius;
  const RayTracer* surfaces;
  Vec3d origin;
  int stretches;
  bool only_if_open;
};

LocalQuery localise(const IrradianceQuery& query, const Vec3d& origin) {
  return {query.position - origin, query.normal, query.min_radius > 0 ? query.min_radius : 0.0,
          query.surfaces,          origin,       query.stretches,
          query.only_if_open};
}

// Whether a surface lies between a record and the query.
bool is_hidden(const SurfaceRecord& record, const LocalQuery& query) {
  if (!query.surfaces) return false;
  constexpr double kOnPlane = 1e-5;  // In radii: below it by rounding.
  const Vec3d p = vector(record.position), n = vector(record.normal), d = query.position - p;
  const double radius = std::min(record.radius[0], record.radius[1]);
  if ((record.flags & kClearFlag) && d.length2() <= radius * radius &&
      d.dot(n) >= -kOnPlane * radius)
    return false;
  return !query.surfaces->sees(query.position + query.origin, query.normal, p + query.origin, n);
}

// The error of IrradianceCache::irradiance(); 1 for who does not answer. Comparisons are written so
// that NaN does not answer.
double error_at(const RecordSite& site, const LocalQuery& query) {
  const Vec3d n = vector(site.normal), d = query.position - vector(site.position);
  const double cosine = n.dot(query.normal);
  if (!(cosine >= kMaxNormalCosine)) return 1;
  const double r1 = std::max(double(site.radius[0]), query.min_radius);
  const double r2 = std::max(double(site.radius[1]), query.min_radius);
  const double rn = std::min(r1, r2);
  // Behind the mean surface of the two points lies other geometry [WRC88].
  if (!(d.dot(n + query.normal) * 0.5 >= -kBehindTolerance * rn)) return 1;
  const Vec3d e1 = vector(site.tangent), e2 = n.cross(e1);
  const double x = d.dot(e1) / r1, y = d.dot(e2) / r2, z = d.dot(n) / rn;
  const double distance2 = x * x + y * y + z * z;
  if (!(distance2 < 1)) return 1;
  // Stored normals are of unit length but for rounding: cosines may pass 1.
  const double turn2 = std::max(0.0, 1 - cosine) / (1 - kMaxNormalCosine);
  return std::sqrt(std::max(distance2, turn2));
}

// E(x', n') ~ E + grad E . (x' - x) + grad_r E . (n x n')  [WH92]. A record's gather vouches for
// its gradient as far as the record reaches by itself. Where only a footprint makes it answer,
// something lies in between or the gradient is steep: from there on what light is taken to change
// by fades, to nothing at kGradientsEnd radii.
RgbD extrapolate(const SurfaceRecord& record, const LocalQuery& query) {
  const Vec3d n = vector(record.normal);
  Vec3d d = query.position - vector(record.position);
  const double radius = std::min(record.radius[0], record.radius[1]), distance = d.length();
  if (distance > radius)
    d *= std::max(0.0, (kGradientsEnd * radius - distance) / ((kGradientsEnd - 1) * distance));
  const Vec3d turn = n.cross(query.normal);
  const Frame frame(n);
  const double turn_u = turn.dot(frame.u), turn_v = turn.dot(frame.v);
  RgbD e;
  for (int c = 0; c < 3; ++c)
    e[c] = record.irradiance[c] + vector(record.gradient + 3 * c).dot(d) +
           (turn_u * record.rotational[2 * c] + turn_v * record.rotational[2 * c + 1]);
  return e;
}

// The one place where a value is kept in its range. `limit` is relative to the record, so that
// scaling all light by a power of two scales every answer exactly. False comparisons send NaN to 0.
double sanitise(double value, double limit) {
  if (!(value >= 0)) return 0;
  return value <= limit ? value : limit;
}

struct Answer {
  std::uint32_t record;
  double weight;
};

// Who answers, in record order. Inline for the usual handful.
class Answers {
 public:
  void add(const Answer& answer) {
    if (size_ < few_.size()) {
      few_[size_++] = answer;
      return;
    }
    if (many_.empty()) many_.assign(few_.begin(), few_.end());
    many_.push_back(answer);
    ++size_;
  }
  bool empty() const { return size_ == 0; }
  std::size_t size() const { return size_; }
  void keep_heaviest(std::size_t most) {
    if (size_ <= most) return;
    const auto all = span();
    std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(most), all.end(),
                     [](const Answer& a, const Answer& b) {
                       return a.weight != b.weight ? a.weight > b.weight : a.record < b.record;
                     });
    size_ = most;
  }
  template <typename Is>
  void remove(const Is& is) {
    const auto all = span();
    const auto end = std::remove_if(all.begin(), all.end(), is);
    size_ = static_cast<std::size_t>(end - all.begin());
  }
  // Record indices are distinct: one order, however the tree was walked.
  std::span<const Answer> in_order() {
    const std::span<Answer> all = span();
    std::sort(all.begin(), all.end(),
              [](const Answer& a, const Answer& b) { return a.record < b.record; });
    return all;
  }

 private:
  std::span<Answer> span() {
    return many_.empty() ? std::span(few_.data(), size_) : std::span(many_.data(), size_);
  }

  std::array<Answer, 48> few_;
  std::size_t size_ = 0;
  std::vector<Answer> many_;
};

// Returns how many there would be if nothing hid any. At most `most` are asked whether they see the
// query, those that weigh most.
std::size_t collect(const RecordIndex& index, std::span<const SurfaceRecord> records,
                    const LocalQuery& query, Answers& answers,
                    std::size_t most = std::numeric_limits<std::size_t>::max()) {
  index.visit(query.position, query.min_radius, [&](const RecordSite& site) {
    const double error = error_at(site, query);
    if (error < 1) {
      // Read soon, and rarely in the cache: its 128 bytes come while the others are sought.
      const char* record = reinterpret_cast<const char*>(&records[site.record]);
      __builtin_prefetch(record);
      __builtin_prefetch(record + 64);
      answers.add({site.record, 1 - error});
    }
    return true;
  });
  const std::size_t count = answers.size();
  answers.keep_heaviest(most);
  answers.remove([&](const Answer& a) { return is_hidden(records[a.record], query); });
  return count;
}

// The same with the query's footprint doubled until somebody answers. Returns how often.
int collect_stretched(const RecordIndex& index, std::span<const SurfaceRecord> records,
                      LocalQuery query, Answers& answers) {
  if (query.only_if_open && query.min_radius > 0) {
    LocalQuery own = query;
    own.min_radius = 0;
    collect(index, records, own, answers);
    if (!answers.empty()) return 0;
  }
  // Who is surrounded by so many that surfaces hide is in another room than all of them.
  constexpr std::size_t kAsked = 12, kSurrounded = 48;
  const std::size_t most = query.only_if_open ? kAsked : std::numeric_limits<std::size_t>::max();
  for (int doublings = 0;; ++doublings, query.min_radius *= 2) {
    const std::size_t count =
        collect(index, records, query, answers, doublings > 0 ? kAsked : most);
    if (!answers.empty() || doublings == query.stretches || count >= kSurrounded) return doublings;
  }
}

}  // namespace

IrradianceCache::IrradianceCache(std::vector<SurfaceRecord> records, const Vec3d& origin,
                                 std::span<const std::uint32_t> curve_order,
                                 std::shared_ptr<const VolumeCache> volume)
    : records_(std::move(records)), origin_(origin), volume_(std::move(volume)) {
  static const auto none = std::make_shared<const VolumeCache>();
  if (!volume_) volume_ = none;
  if (!std::is_sorted(records_.begin(), records_.end(), RecordOrder{})) {
    std::stable_sort(records_.begin(), records_.end(), RecordOrder{});
    curve_order = {};
  }
  if (curve_order.size() != records_.size()) curve_order = {};
  if (!records_.empty()) layers_.resize(static_cast<std::size_t>(records_.back().layer()) + 1);
  for (std::size_t begin = 0; begin < records_.size();) {
    const int layer = records_[begin].layer();
    const auto end =
        std::partition_point(records_.begin() + static_cast<std::ptrdiff_t>(begin), records_.end(),
                             [&](const SurfaceRecord& record) { return record.layer() <= layer; });
    const auto stop = static_cast<std::size_t>(end - records_.begin());
    layers_[static_cast<std::size_t>(layer)] =
        curve_order.empty() ? RecordIndex(records_, begin, stop)
                            : RecordIndex(records_, curve_order.subspan(begin, stop - begin));
    begin = stop;
  }
}

std::vector<std::uint32_t> IrradianceCache::curve_order(int layer) const {
  const RecordIndex* index = this->layer(layer);
  return index ? index->curve_order() : std::vector<std::uint32_t>();
}

const RecordIndex* IrradianceCache::layer(int layer) const {
  const auto i = static_cast<std::size_t>(layer);
  return layer >= 0 && i < layers_.size() ? &layers_[i] : nullptr;
}

InterpolatedIrradiance IrradianceCache::irradiance(const IrradianceQuery& query) const {
  InterpolatedIrradiance result;
  const RecordIndex* index = layer(query.layer);
  if (!index) return result;
  const LocalQuery local = localise(query, origin_);
  Answers answers;
  result.stretches = collect_stretched(*index, records_, local, answers);

  // Mean = E0 + sum w (E - E0) / sum w: equal values come back as they are, bit for bit.
  RgbD first, sum;
  double weights = 0, light = 0, media = 0;
  for (const Answer& answer : answers.in_order()) {
    const SurfaceRecord& record = records_[answer.record];
    const RgbD raw = extrapolate(record, local);
    RgbD kept;
    for (int c = 0; c < 3; ++c) {
      kept[c] = sanitise(raw[c], 2 * double(record.irradiance[c]));
      result.clamped |= kept[c] != raw[c];
    }
    if (result.records++ == 0) first = kept;
    sum += (kept - first) * answer.weight;
    weights += answer.weight;
    const double brightness = answer.weight * luminance(kept);
    light += brightness;
    media += brightness * record.media_share;
  }
  if (result.records == 0) return result;
  for (int c = 0; c < 3; ++c)
    result.irradiance[c] =
        sanitise(first[c] + sum[c] / weights, std::numeric_limits<double>::max());
  result.media_share = light > 0 ? sanitise(media / light, 1) : 0;
  return result;
}

bool IrradianceCache::covers(const IrradianceQuery& query, double max_error) const {
  const RecordIndex* index = layer(query.layer);
  if (!index) return false;
  const LocalQuery local = localise(query, origin_);
  const double limit = std::min(max_error, 1.0);
  bool covered = false;
  index->visit(local.position, local.min_radius, [&](const RecordSite& site) {
    covered = error_at(site, local) < limit && !is_hidden(records_[site.record], local);
    return !covered;
  });
  return covered;
}

std::vector<RecordWeight> IrradianceCache::explain(const IrradianceQuery& query) const {
  std::vector<RecordWeight> result;
  const RecordIndex* index = layer(query.layer);
  if (!index) return result;
  const LocalQuery local = localise(query, origin_);
  Answers answers;
  collect_stretched(*index, records_, local, answers);
  for (const Answer& answer : answers.in_order()) {
    const SurfaceRecord& record = records_[answer.record];
    result.push_back({&record, answer.weight, extrapolate(record, local)});
  }
  return result;
}

}  // namespace brume
