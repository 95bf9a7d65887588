#include "cache/irradiance_cache.h"

#include <gtest/gtest.h>

#include <set>

#include "cache/hilbert_curve.h"
#include "sample_records.h"

namespace brume {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

Vec3d vector(const float* v) { return {v[0], v[1], v[2]}; }

// Round, on the plane z = 0, facing up, without gradients.
SurfaceRecord flat_record(double x, double y, double irradiance, double radius = 1) {
  SurfaceRecord record{};
  record.position[0] = static_cast<float>(x);
  record.position[1] = static_cast<float>(y);
  record.normal[2] = 1;
  for (float& e : record.irradiance) e = static_cast<float>(irradiance);
  for (float& r : record.radius) r = static_cast<float>(radius);
  record.flags = record_flags(1, 0);
  return record;
}

std::vector<SurfaceRecord> with_keys(std::vector<SurfaceRecord> records) {
  for (std::size_t i = 0; i < records.size(); ++i) records[i].key = i;
  return records;
}

IrradianceQuery query_at(const Vec3d& position, const Vec3d& normal = {0, 0, 1}) {
  return {1, position, normal, 0};
}

// The formulas of the header, one record at a time, with nothing shared with the code under test.
double expected_error(const SurfaceRecord& record, const IrradianceQuery& q, const Vec3d& origin) {
  const Vec3d n = vector(record.normal), d = q.position - origin - vector(record.position);
  const double r1 = std::max<double>(record.radius[0], q.min_radius),
               r2 = std::max<double>(record.radius[1], q.min_radius), rn = std::min(r1, r2);
  const double cosine = n.dot(q.normal);
  if (cosine < 0.8 || d.dot(n + q.normal) / 2 < -0.05 * rn) return 1;
  const Frame frame(n);
  const double a = record.axis;
  const Vec3d e1 = frame.u * std::cos(a) + frame.v * std::sin(a),
              e2 = frame.v * std::cos(a) - frame.u * std::sin(a);
  const double rho = std::sqrt(std::pow(d.dot(e1) / r1, 2) + std::pow(d.dot(e2) / r2, 2) +
                               std::pow(d.dot(n) / rn, 2));
  return std::max(rho, std::sqrt(std::max(0.0, 1 - cosine) / 0.2));
}

TEST(IrradianceCache, ALoneRecordReturnsItselfAtItsPoint) {
  for (const SurfaceRecord& record : sample_records(200)) {
    const Vec3d origin(3, -2, 8);
    const IrradianceCache cache({record}, origin);
    const InterpolatedIrradiance e =
        cache.irradiance(query_at(origin + vector(record.position), vector(record.normal)));
    ASSERT_EQ(e.records, 1);
    EXPECT_FALSE(e.clamped);
    EXPECT_NEAR(e.media_share, record.media_share, 1e-7);
    // Adding and taking off the origin moves the point by an ulp of it.
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(e.irradiance[c], record.irradiance[c], 1e-13);
    const InterpolatedIrradiance exact =
        IrradianceCache({record}, Vec3d(0.0))
            .irradiance(query_at(vector(record.position), vector(record.normal)));
    for (int c = 0; c < 3; ++c) EXPECT_EQ(exact.irradiance[c], double(record.irradiance[c]));
  }
}

TEST(IrradianceCache, EqualRecordsGiveTheirValueEverywhere) {
  std::vector<SurfaceRecord> records;
  for (int i = 0; i < 400; ++i) records.push_back(flat_record(i % 20 * 0.3, i / 20 * 0.3, 0.3));
  const IrradianceCache cache(with_keys(records), Vec3d(0.0));
  RandomStream random(5);
  for (int i = 0; i < 2000; ++i) {
    const InterpolatedIrradiance e =
        cache.irradiance(query_at({6 * random.uniform(), 6 * random.uniform(), 0.01}));
    ASSERT_GT(e.records, 1);
    for (int c = 0; c < 3; ++c) EXPECT_EQ(e.irradiance[c], double(0.3f));
  }
}

TEST(IrradianceCache, ReproducesALinearFieldThroughGradients) {
  std::vector<SurfaceRecord> records;
  for (int i = 0; i < 100; ++i) {
    SurfaceRecord record = flat_record(i % 10 * 0.1, i / 10 * 0.1, 0, 0.3);
    for (int c = 0; c < 3; ++c) {
      record.irradiance[c] =
          5 + record.position[0] - 2 * record.position[1] + static_cast<float>(c);
      record.gradient[3 * c] = 1;
      record.gradient[3 * c + 1] = -2;
    }
    records.push_back(record);
  }
  const IrradianceCache cache(with_keys(records), Vec3d(0.0));
  for (double x = 0.05; x < 0.9; x += 0.07) {
    const InterpolatedIrradiance e = cache.irradiance(query_at({x, 1 - x, 0}));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(e.irradiance[c], 5 + x - 2 * (1 - x) + c, 1e-6);
    EXPECT_FALSE(e.clamped);
  }
}

TEST(IrradianceCache, TurnsWithTheRotationalGradient) {
  // E = a.n for a record's own n: dE/dn is a, and grad_r.(n x n') = a.(n' - n) to first order.
  const Vec3d a(0.3, -0.2, 1.0);
  for (SurfaceRecord record : sample_records(50)) {
    const Vec3d n = vector(record.normal);
    if (a.dot(n) < 0.3) continue;
    const Frame frame(n);
    const Vec3d rotational = n.cross(a);
    for (int c = 0; c < 3; ++c) {
      record.irradiance[c] = static_cast<float>(a.dot(n));
      record.rotational[2 * c] = static_cast<float>(rotational.dot(frame.u));
      record.rotational[2 * c + 1] = static_cast<float>(rotational.dot(frame.v));
    }
    const IrradianceCache cache({record}, Vec3d(0.0));
    for (double angle : {-0.02, 0.01, 0.05}) {
      const Vec3d turned = (n + (frame.u * 0.6 + frame.v * 0.8) * angle).normalized();
      const InterpolatedIrradiance e = cache.irradiance(query_at(vector(record.position), turned));
      ASSERT_EQ(e.records, 1);
      EXPECT_NEAR(e.irradiance.g, a.dot(turned), angle * angle);
    }
  }
}

TEST(IrradianceCache, FindsExactlyWhoAnswers) {
  const Vec3d origin(100, 200, -300);
  const std::vector<SurfaceRecord> records = sample_records(3000);
  const IrradianceCache cache(records, origin);
  RandomStream random(9);
  int answers = 0;
  for (int i = 0; i < 1500; ++i) {
    IrradianceQuery q =
        query_at({random.uniform(), random.uniform(), random.uniform()}, random_direction(random));
    q.position += origin;
    // Below all radii, between them, above them, and so large that all are near.
    q.min_radius = std::array<double, 5>{0, 0.12, 0.15, 0.3, 4}[static_cast<std::size_t>(i) % 5];
    std::vector<std::uint64_t> expected;
    for (const SurfaceRecord& record : records)
      if (expected_error(record, q, origin) < 1) expected.push_back(record.key);
    std::vector<std::uint64_t> found;
    for (const RecordWeight& part : cache.explain(q)) {
      found.push_back(part.record->key);
      EXPECT_NEAR(part.weight, 1 - expected_error(*part.record, q, origin), 1e-5);
    }
    ASSERT_EQ(found, expected) << "query " << i;
    answers += static_cast<int>(found.size());
    ASSERT_EQ(cache.irradiance(q).records, static_cast<int>(found.size()));
    ASSERT_EQ(cache.covers(q), !found.empty());
  }
  EXPECT_GT(answers, 10000);
}

TEST(IrradianceCache, WeighsTheMeanOfWhatExplainTells) {
  const IrradianceCache cache(sample_records(3000), Vec3d(0.0));
  RandomStream random(10);
  int several = 0;
  for (int i = 0; i < 1000; ++i) {
    IrradianceQuery q =
        query_at({random.uniform(), random.uniform(), random.uniform()}, random_direction(random));
    q.min_radius = 0.2;
    double weights = 0;
    RgbD sum;
    for (const RecordWeight& part : cache.explain(q)) {
      weights += part.weight;
      for (int c = 0; c < 3; ++c)
        sum[c] +=
            part.weight * std::clamp(part.extrapolated[c], 0.0, 2.0 * part.record->irradiance[c]);
    }
    if (weights == 0) continue;
    several += cache.explain(q).size() > 1;
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(cache.irradiance(q).irradiance[c], sum[c] / weights, 1e-12);
  }
  EXPECT_GT(several, 100);
}

TEST(IrradianceCache, KeepsExtrapolationsBetweenZeroAndTwiceTheValue) {
  SurfaceRecord record = flat_record(0, 0, 1);
  for (int c = 0; c < 3; ++c) record.gradient[3 * c] = -4;
  const IrradianceCache cache({record}, Vec3d(0.0));
  const InterpolatedIrradiance low = cache.irradiance(query_at({0.3, 0, 0}));
  EXPECT_EQ(low.irradiance, RgbD(0.0));
  EXPECT_TRUE(low.clamped);
  const InterpolatedIrradiance high = cache.irradiance(query_at({-0.3, 0, 0}));
  EXPECT_EQ(high.irradiance, RgbD(2.0));
  EXPECT_TRUE(high.clamped);
  const InterpolatedIrradiance inside = cache.irradiance(query_at({-0.1, 0, 0}));
  EXPECT_NEAR(inside.irradiance.r, 1.4, 1e-7);
  EXPECT_FALSE(inside.clamped);
}

// Within its radius a record's gradient counts whole; where a footprint alone makes it answer it
// fades.
TEST(IrradianceCache, FadesGradientsBeyondARecordsOwnRadius) {
  SurfaceRecord record = flat_record(0, 0, 1, 0.125);
  record.gradient[0] = record.gradient[3] = record.gradient[6] = 0.5;
  const IrradianceCache cache({record}, Vec3d(0.0));
  const auto change = [&](double x) {
    IrradianceQuery query = query_at({x, 0, 0});
    query.min_radius = 4;
    return cache.irradiance(query).irradiance.r - 1;
  };
  EXPECT_NEAR(change(0.1), 0.05, 1e-9);
  EXPECT_NEAR(change(0.125), 0.0625, 1e-9);
  EXPECT_NEAR(change(-0.125), -0.0625, 1e-9);
  EXPECT_NEAR(change(0.5), 0.0625 * 4 / 7, 1e-9);
  EXPECT_NEAR(change(1), 0, 1e-12);
  EXPECT_NEAR(change(3), 0, 1e-12);
}

TEST(IrradianceCache, LeavesOutWhoLooksAwayOrLiesBehind) {
  const IrradianceCache cache({flat_record(0, 0, 1)}, Vec3d(0.0));
  EXPECT_EQ(cache.irradiance(query_at({0, 0, 0}, {0, 0, -1})).records, 0);
  EXPECT_EQ(cache.irradiance(query_at({0, 0, 0}, Vec3d(1, 0, 1).normalized())).records, 0);
  EXPECT_EQ(cache.irradiance(query_at({0, 0, 0}, Vec3d(0.5, 0, 1).normalized())).records, 1);
  EXPECT_EQ(cache.irradiance(query_at({0, 0, -0.04})).records, 1);
  EXPECT_EQ(cache.irradiance(query_at({0, 0, -0.06})).records, 0);
  EXPECT_EQ(cache.irradiance(query_at({0, 0, 0.06})).records, 1);
  EXPECT_EQ(cache.irradiance(query_at({0, 0, 0}, {0, 0, 0})).records, 0);
}

TEST(IrradianceCache, LayersDoNotMix) {
  SurfaceRecord first = flat_record(0, 0, 1), second = flat_record(0, 0, 2);
  second.flags = record_flags(3, 0);
  const IrradianceCache cache({first, second}, Vec3d(0.0));
  IrradianceQuery q = query_at({0, 0, 0});
  for (const auto& [layer, value] : {std::pair{1, 1.0}, {3, 2.0}}) {
    q.layer = layer;
    EXPECT_EQ(cache.irradiance(q).irradiance.r, value);
  }
  for (int layer : {-1, 0, 2, 4, 255, 1 << 30}) {
    q.layer = layer;
    EXPECT_EQ(cache.irradiance(q).records, 0) << layer;
    EXPECT_FALSE(cache.covers(q));
  }
}

TEST(IrradianceCache, CoversOnlyBelowTheErrorAskedFor) {
  const IrradianceCache cache({flat_record(0, 0, 1)}, Vec3d(0.0));
  EXPECT_TRUE(cache.covers(query_at({0.4, 0, 0}), 0.5));
  EXPECT_FALSE(cache.covers(query_at({0.6, 0, 0}), 0.5));
  EXPECT_TRUE(cache.covers(query_at({0.6, 0, 0})));
  EXPECT_FALSE(cache.covers(query_at({1.1, 0, 0}), 2));
}

TEST(IrradianceCache, ScalesWithItsRecordsBitForBit) {
  std::vector<SurfaceRecord> records = sample_records(2000);
  const IrradianceCache cache(records, Vec3d(0.0));
  for (int k : {-30, -1, 3, 40}) {
    std::vector<SurfaceRecord> scaled = records;
    for (SurfaceRecord& record : scaled) {
      for (float& x : record.irradiance) x = std::ldexp(x, k);
      for (float& x : record.gradient) x = std::ldexp(x, k);
      for (float& x : record.rotational) x = std::ldexp(x, k);
      record.error = std::ldexp(record.error, k);
    }
    const IrradianceCache other(scaled, Vec3d(0.0));
    RandomStream random(11);
    for (int i = 0; i < 1000; ++i) {
      IrradianceQuery q = query_at({random.uniform(), random.uniform(), random.uniform()},
                                   random_direction(random));
      q.min_radius = 0.3;
      const InterpolatedIrradiance a = cache.irradiance(q), b = other.irradiance(q);
      ASSERT_EQ(a.records, b.records);
      EXPECT_EQ(a.clamped, b.clamped);
      EXPECT_EQ(a.media_share, b.media_share);
      for (int c = 0; c < 3; ++c) EXPECT_EQ(std::ldexp(a.irradiance[c], k), b.irradiance[c]);
    }
  }
}

TEST(IrradianceCache, KeepsItsDigitsFarFromTheWorldsOrigin) {
  const std::vector<SurfaceRecord> records = sample_records(2000);
  const IrradianceCache near(records, Vec3d(0.0));
  const Vec3d origin(0x1p23, -0x1p22, 0x1p24);
  const IrradianceCache far(records, origin);
  RandomStream random(12);
  for (int i = 0; i < 500; ++i) {
    // On a grid of 2^-20, so that adding the origin is exact.
    const auto place = [&] { return std::floor(random.uniform() * 0x1p20) * 0x1p-20; };
    IrradianceQuery q = query_at({place(), place(), place()}, random_direction(random));
    q.min_radius = 0.2;
    const InterpolatedIrradiance a = near.irradiance(q);
    q.position += origin;
    const InterpolatedIrradiance b = far.irradiance(q);
    EXPECT_EQ(a.records, b.records);
    EXPECT_EQ(a.irradiance, b.irradiance);
  }
}

TEST(IrradianceCache, DoesNotDependOnTheOrderRecordsComeIn) {
  std::vector<SurfaceRecord> records = sample_records(1000);
  const IrradianceCache cache(records, Vec3d(0.0));
  std::reverse(records.begin(), records.end());
  const IrradianceCache reversed(records, Vec3d(0.0));
  RandomStream random(13);
  for (int i = 0; i < 300; ++i) {
    IrradianceQuery q =
        query_at({random.uniform(), random.uniform(), random.uniform()}, random_direction(random));
    q.min_radius = 0.4;
    EXPECT_EQ(cache.irradiance(q).irradiance, reversed.irradiance(q).irradiance);
  }
}

TEST(IrradianceCache, HundredsMayAnswerAtOnce) {
  std::vector<SurfaceRecord> records;
  for (int i = 0; i < 500; ++i) records.push_back(flat_record(1e-4 * i, 0, 1 + i));
  const IrradianceCache cache(with_keys(records), Vec3d(0.0));
  const std::vector<RecordWeight> parts = cache.explain(query_at({0, 0, 0}));
  ASSERT_EQ(parts.size(), 500u);
  for (std::size_t i = 0; i < parts.size(); ++i) EXPECT_EQ(parts[i].record->key, i);
  EXPECT_EQ(cache.irradiance(query_at({0, 0, 0})).records, 500);
}

TEST(IrradianceCache, NeverAnswersWithNan) {
  std::vector<SurfaceRecord> records = sample_records(300);
  // Every float of some record turns bad, in each of several ways.
  const float bad[] = {kNan, std::numeric_limits<float>::infinity(), -1e30f, 1e30f, 0.0f, 1e-42f};
  RandomStream random(14);
  std::size_t word = 0;
  for (SurfaceRecord& record : records) {
    float* floats = record.position;
    floats[word % 28] = bad[word / 28 % 6];
    ++word;
  }
  const IrradianceCache cache(records, Vec3d(0.0));
  const double nan = kNan, infinity = kInfinity;
  const Vec3d odd[] = {{nan, 0, 0}, {infinity, 0, 0}, {1e300, 1e300, 0}, {0, 0, 0}, {1e-320, 0, 0}};
  for (int i = 0; i < 3000; ++i) {
    IrradianceQuery q =
        query_at({random.uniform(), random.uniform(), random.uniform()}, random_direction(random));
    if (i % 7 == 0) q.position = odd[i / 7 % 5];
    if (i % 11 == 0) q.normal = odd[i / 11 % 5];
    q.min_radius =
        std::array<double, 6>{0, nan, infinity, -1, 1e300, 0.5}[static_cast<std::size_t>(i) % 6];
    const InterpolatedIrradiance e = cache.irradiance(q);
    ASSERT_TRUE(is_finite(e.irradiance) && std::isfinite(e.media_share)) << "query " << i;
    for (int c = 0; c < 3; ++c) ASSERT_GE(e.irradiance[c], 0);
  }
}

TEST(IrradianceCache, AnEmptyOneAnswersNothing) {
  const IrradianceCache cache;
  EXPECT_EQ(cache.irradiance(query_at({0, 0, 0})).records, 0);
  EXPECT_EQ(cache.irradiance(query_at({0, 0, 0})).irradiance, RgbD(0.0));
  EXPECT_TRUE(cache.explain(query_at({0, 0, 0})).empty());
}

TEST(HilbertCurve, VisitsEveryCellOnceAndStepsToANeighbour) {
  constexpr int kBits = 4, kSide = 1 << kBits;
  std::vector<std::array<int, 3>> path(kSide * kSide * kSide, {-1, -1, -1});
  for (std::uint32_t z = 0; z < kSide; ++z)
    for (std::uint32_t y = 0; y < kSide; ++y)
      for (std::uint32_t x = 0; x < kSide; ++x) {
        const std::uint64_t i = hilbert_index({x, y, z}, kBits);
        ASSERT_LT(i, path.size());
        ASSERT_EQ(path[i][0], -1) << "twice";
        path[i] = {static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)};
      }
  for (std::size_t i = 1; i < path.size(); ++i) {
    int distance = 0;
    for (std::size_t a = 0; a < 3; ++a) distance += std::abs(path[i][a] - path[i - 1][a]);
    ASSERT_EQ(distance, 1) << "step " << i;
  }
}

// A wall at x = 0 between two records: neither answers on the other's side, however wide it is or a
// footprint makes it; of those that a wall hides all, a stretched query finds whoever is in sight.
TEST(IrradianceCache, NoRecordAnswersThroughASurface) {
  TriangleMesh ground, wall;
  ground.positions = {{-5, -5, 0}, {5, -5, 0}, {5, 5, 0}, {-5, 5, 0}};
  ground.triangles = {{0, 1, 2}, {0, 2, 3}};
  wall.positions = {{0, -5, 0}, {0, 5, 0}, {0, 5, 5}, {0, -5, 5}};
  wall.triangles = {{0, 1, 2}, {0, 2, 3}};
  const RayTracer surfaces({ground, wall});
  SurfaceRecord lit = flat_record(-0.01, 0, 1, 2), dark = flat_record(0.5, 0, 0, 0.1);
  const IrradianceCache cache(with_keys({lit, dark}), Vec3d(0.0));
  IrradianceQuery query = query_at({0.02, 0, 0});
  EXPECT_EQ(cache.irradiance(query).records, 1);
  query.surfaces = &surfaces;
  EXPECT_FALSE(cache.covers(query));
  EXPECT_EQ(cache.irradiance(query).records, 0);
  query.min_radius = 0.2;
  EXPECT_EQ(cache.irradiance(query).records, 0);
  query.stretches = 3;
  const InterpolatedIrradiance e = cache.irradiance(query);
  EXPECT_EQ(e.records, 1);
  EXPECT_EQ(e.stretches, 2);
  EXPECT_EQ(e.irradiance.g, 0);
  ASSERT_EQ(cache.explain(query).size(), 1u);
  EXPECT_EQ(cache.explain(query)[0].record->irradiance[1], 0);
  // On its own side the lit one answers.
  query = query_at({-0.5, 0, 0});
  query.surfaces = &surfaces;
  EXPECT_EQ(cache.irradiance(query).irradiance.g, 1);
}

// A record that says that its surroundings are clear is believed, within its radius and above its
// plane.
TEST(IrradianceCache, AClearRecordIsBelieved) {
  TriangleMesh plate;
  plate.positions = {{0.1, -5, -5}, {0.1, 5, -5}, {0.1, 5, 5}, {0.1, -5, 5}};
  plate.triangles = {{0, 1, 2}, {0, 2, 3}};
  const RayTracer surfaces({plate});
  SurfaceRecord record = flat_record(0, 0, 1, 0.3);
  record.flags |= kClearFlag;
  const IrradianceCache cache({record}, Vec3d(0.0));
  const auto answers = [&](const Vec3d& p, double min_radius) {
    IrradianceQuery query = query_at(p);
    query.surfaces = &surfaces;
    query.min_radius = min_radius;
    return cache.irradiance(query).records;
  };
  EXPECT_EQ(answers({0.2, 0, 0}, 0), 1);
  EXPECT_EQ(answers({0.4, 0, 0}, 1), 0);      // Beyond its radius a ray decides,
  EXPECT_EQ(answers({0.2, 0, -0.01}, 0), 0);  // and below its plane.
}

}  // namespace
}  // namespace brume
