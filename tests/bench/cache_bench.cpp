// A cache of a million records: building its index, asking it in image order, writing and reading it.
//
// The records lie on the walls, floor and boxes of a room at random, more densely and with smaller radii
// towards one corner, so that a point meets about seven of them. Clamping against neighbours keeps radii
// of one place alike; `query/mixed` asks what it costs where one in 64 is six times as large.
#include <benchmark/benchmark.h>
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <filesystem>

#include "cache/cache_file.h"
#include "cache/irradiance_cache.h"
#include "core/parallel.h"
#include "core/random.h"

namespace brume {
namespace {

constexpr std::size_t kRecords = 1'000'000;

struct Wall {
  Vec3d corner, u, v;
  Vec3d normal() const { return u.cross(v).normalized(); }
  double area() const { return u.cross(v).length(); }
};

std::vector<Wall> room() {
  std::vector<Wall> walls = {
      {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}, {{0, 0, 3}, {0, 4, 0}, {4, 0, 0}},
      {{0, 0, 0}, {0, 4, 0}, {0, 0, 3}}, {{4, 0, 0}, {0, 0, 3}, {0, 4, 0}},
      {{0, 4, 0}, {4, 0, 0}, {0, 0, 3}}, {{0, 0, 0}, {0, 0, 3}, {4, 0, 0}},
  };
  for (int i = 0; i < 8; ++i) {  // Sides of boxes, turned.
    const double a = 0.4 * i;
    walls.push_back({{1 + 0.25 * i, 1.5, 0.2}, {std::cos(a), std::sin(a), 0}, {0, 0, 1}});
  }
  return walls;
}

Vec3d point_on(const Wall& wall, const Vec2d& u) { return wall.corner + wall.u * u.x + wall.v * u.y; }

std::vector<SurfaceRecord> make_records(std::size_t count, bool mixed) {
  const std::vector<Wall> walls = room();
  double area = 0;
  for (const Wall& wall : walls) area += wall.area();
  const double radius = std::sqrt(4.5 * area / (kPi * static_cast<double>(count)));
  std::vector<SurfaceRecord> records(count);
  RandomStream random(random_key(17));
  for (std::size_t i = 0; i < count; ++i) {
    double pick = random.uniform() * area;
    std::size_t w = 0;
    while (w + 1 < walls.size() && pick > walls[w].area()) pick -= walls[w++].area();
    // Density 1 / (2 sqrt(x)) across a wall, and radii to match: from a third of the mean to 1.4 times.
    Vec2d u = random.uniform2();
    const double spread = 0.05 + 0.95 * u.x;
    u.x *= u.x;
    const Vec3d p = point_on(walls[w], u), n = walls[w].normal();
    const bool is_large = mixed && i < count / 64;
    SurfaceRecord& record = records[i];
    record = {};
    for (int a = 0; a < 3; ++a) {
      record.position[a] = static_cast<float>(p[a]);
      record.normal[a] = static_cast<float>(n[a]);
      record.irradiance[a] = static_cast<float>(1 + random.uniform());
    }
    for (float& g : record.gradient) g = static_cast<float>(random.uniform() - 0.5);
    for (float& g : record.rotational) g = static_cast<float>(random.uniform() - 0.5);
    record.axis = static_cast<float>(kPi * random.uniform());
    const double r = radius * std::sqrt(2 * spread) * (0.7 + 0.6 * random.uniform()) * (is_large ? 6 : 1);
    record.radius[0] = static_cast<float>(r);
    record.radius[1] = static_cast<float>(r * (0.7 + 0.6 * random.uniform()));
    record.flags = record_flags(1, is_large ? 0 : 1);
    record.key = random.bits();
  }
  std::sort(records.begin(), records.end(), RecordOrder{});
  return records;
}

const std::vector<SurfaceRecord>& million() {
  static const std::vector<SurfaceRecord> records = make_records(kRecords, false);
  return records;
}

std::filesystem::path scratch_file(bool mixed) {
  return std::filesystem::temp_directory_path() /
         (mixed ? "brume_bench_mixed.irc" : "brume_bench.irc");
}
IrradianceCache open_scratch(bool mixed, bool uses_order) {
  CacheOpening opening = open_cache(scratch_file(mixed), {});
  return {std::move(opening.contents.records), opening.contents.header.origin,
          uses_order ? opening.contents.curve_order : std::vector<std::uint32_t>()};
}
// As a renderer has it: read from its file.
const IrradianceCache& cache_of_a_million(bool mixed) {
  const auto make = [](bool is_mixed) {
    const auto& records = is_mixed ? make_records(kRecords, true) : million();
    write_cache(scratch_file(is_mixed), {}, IrradianceCache(records, Vec3d(0.0)));
    return open_scratch(is_mixed, true);
  };
  static const IrradianceCache even = make(false), with_large = make(true);
  return mixed ? with_large : even;
}

// What the pixels of a picture of two megapixels ask: a scan over three walls and a box, row by row.
std::vector<IrradianceQuery> image_queries(double min_radius) {
  constexpr int kRows = 760;
  const std::vector<Wall> walls = room();
  std::vector<IrradianceQuery> queries;
  for (const Wall& wall : {walls[0], walls[3], walls[4], walls[7]})
    for (int y = 0; y < kRows; ++y)
      for (int x = 0; x < kRows; ++x)
        queries.push_back({1, point_on(wall, {(x + 0.5) / kRows, (y + 0.5) / kRows}), wall.normal(),
                           min_radius});
  return queries;
}

void build_index(benchmark::State& state) {
  for (auto _ : state) {
    state.PauseTiming();
    std::vector<SurfaceRecord> records = million();
    state.ResumeTiming();
    const IrradianceCache cache(std::move(records), Vec3d(0.0));
    benchmark::DoNotOptimize(cache.records().data());
  }
}
BENCHMARK(build_index)->Unit(benchmark::kMillisecond)->UseRealTime();

template <typename Ask>
void ask_in_image_order(benchmark::State& state, bool mixed, double min_radius, Ask&& ask) {
  const IrradianceCache& cache = cache_of_a_million(mixed);
  const std::vector<IrradianceQuery> queries = image_queries(min_radius);
  double records = 0, asked = 0;
  for (auto _ : state)
    for (const IrradianceQuery& query : queries) {
      records += ask(cache, query);
      asked += 1;
    }
  state.counters["records"] = records / asked;
  state.counters["per_query"] =
      benchmark::Counter(asked, benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}

void query(benchmark::State& state) {
  // In millimetres; the records' radii are about 10.
  ask_in_image_order(state, state.range(0) != 0, 1e-3 * static_cast<double>(state.range(1)),
                     [](const IrradianceCache& cache, const IrradianceQuery& q) {
                       return cache.irradiance(q).records;
                     });
}
BENCHMARK(query)
    ->ArgNames({"mixed", "min_radius_mm"})
    ->Args({0, 0})
    ->Args({0, 10})
    ->Args({1, 0})
    ->Unit(benchmark::kMillisecond);

void covers(benchmark::State& state) {
  ask_in_image_order(state, false, 0, [](const IrradianceCache& cache, const IrradianceQuery& q) {
    return cache.covers(q) ? 1 : 0;
  });
}
BENCHMARK(covers)->Unit(benchmark::kMillisecond);

// The test that both trees are asked for: less work than an answer, which adds records up. A site
// or a record.
template <typename Record>
bool reaches(const Record& r, const IrradianceQuery& query) {
  const Vec3d n(r.normal[0], r.normal[1], r.normal[2]);
  if (n.dot(query.normal) < kMaxNormalCosine) return false;
  const Vec3d d = query.position - Vec3d(r.position[0], r.position[1], r.position[2]);
  const double reach = std::max(r.radius[0], r.radius[1]);
  return d.length2() < reach * reach;
}

void index_count(benchmark::State& state) {
  static const RecordIndex index(million(), 0, million().size());
  ask_in_image_order(state, false, 0, [](const IrradianceCache&, const IrradianceQuery& q) {
    int count = 0;
    index.visit(q.position, 0, [&](const RecordSite& site) {
      count += reaches(site, q);
      return true;
    });
    return count;
  });
}
BENCHMARK(index_count)->Unit(benchmark::kMillisecond);

// DESIGN 4.8: the same queries put to Embree, whose tree over the bounds of the supports calls back
// for each record whose bounds hold the point.
class EmbreeLookup {
 public:
  explicit EmbreeLookup(std::span<const SurfaceRecord> records) : records_(records) {
    device_ = rtcNewDevice(nullptr);
    scene_ = rtcNewScene(device_);
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
    const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(records.size()));
    rtcSetGeometryUserData(geometry, this);
    rtcSetGeometryBoundsFunction(geometry, bounds, nullptr);
    rtcSetGeometryPointQueryFunction(geometry, answer);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene_);
  }
  ~EmbreeLookup() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  EmbreeLookup(const EmbreeLookup&) = delete;
  EmbreeLookup& operator=(const EmbreeLookup&) = delete;

  int count(const IrradianceQuery& query) const {
    RTCPointQuery point{};
    point.x = static_cast<float>(query.position.x);
    point.y = static_cast<float>(query.position.y);
    point.z = static_cast<float>(query.position.z);
    RTCPointQueryContext context;
    rtcInitPointQueryContext(&context);
    State state{this, &query, 0};
    rtcPointQuery(scene_, &point, &context, nullptr, &state);
    return state.count;
  }

 private:
  struct State {
    const EmbreeLookup* lookup;
    const IrradianceQuery* query;
    int count;
  };
  static void bounds(const RTCBoundsFunctionArguments* arguments) {
    const auto* lookup = static_cast<const EmbreeLookup*>(arguments->geometryUserPtr);
    const SurfaceRecord& r = lookup->records_[arguments->primID];
    const float wide = std::max(r.radius[0], r.radius[1]),
                narrow = std::min(r.radius[0], r.radius[1]);
    float half[3];
    for (int a = 0; a < 3; ++a)
      half[a] = std::sqrt(wide * wide * (1 - r.normal[a] * r.normal[a]) +
                          narrow * narrow * r.normal[a] * r.normal[a]);
    RTCBounds& box = *arguments->bounds_o;
    box.lower_x = r.position[0] - half[0], box.upper_x = r.position[0] + half[0];
    box.lower_y = r.position[1] - half[1], box.upper_y = r.position[1] + half[1];
    box.lower_z = r.position[2] - half[2], box.upper_z = r.position[2] + half[2];
  }
  static bool answer(RTCPointQueryFunctionArguments* arguments) {
    State& state = *static_cast<State*>(arguments->userPtr);
    state.count += reaches(state.lookup->records_[arguments->primID], *state.query);
    return false;
  }

  std::span<const SurfaceRecord> records_;
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
};

void embree_build(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(EmbreeLookup(million()));
}
BENCHMARK(embree_build)->Unit(benchmark::kMillisecond)->UseRealTime();

void embree_count(benchmark::State& state) {
  static const EmbreeLookup lookup(million());
  ask_in_image_order(state, false, 0, [](const IrradianceCache&, const IrradianceQuery& q) {
    return lookup.count(q);
  });
}
BENCHMARK(embree_count)->Unit(benchmark::kMillisecond);

void write_file(benchmark::State& state) {
  for (auto _ : state) write_cache(scratch_file(false), {}, cache_of_a_million(false));
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(kRecords * sizeof(SurfaceRecord)));
}
BENCHMARK(write_file)->Unit(benchmark::kMillisecond)->UseRealTime();

void read_file(benchmark::State& state) {
  (void)cache_of_a_million(false);  // Writes the file.
  for (auto _ : state) {
    const CacheOpening opening = open_cache(scratch_file(false), {});
    if (opening.state != CacheState::Loaded) state.SkipWithError(opening.reason.c_str());
  }
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(kRecords * sizeof(SurfaceRecord)));
}
BENCHMARK(read_file)->Unit(benchmark::kMillisecond)->UseRealTime();

void ready_for_first_query(benchmark::State& state) {
  (void)cache_of_a_million(false);  // Writes the file.
  for (auto _ : state) {
    const IrradianceCache cache = open_scratch(false, state.range(0) != 0);
    benchmark::DoNotOptimize(cache.irradiance({1, {1, 1, 0}, {0, 0, 1}}).records);
  }
}
BENCHMARK(ready_for_first_query)
    ->ArgName("stored_order")
    ->Arg(0)
    ->Arg(1)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace brume

int main(int argc, char** argv) {
  brume::flush_denormals();
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
  for (const bool mixed : {false, true}) std::filesystem::remove(brume::scratch_file(mixed));
}
