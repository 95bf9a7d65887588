// A gather in vacuum against the bare packets it is made of (DESIGN 5: at least 80 %), and what the
// medium adds. Rays per second are the figure to compare: `rays` counts gather rays in each row.
#include <benchmark/benchmark.h>
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <filesystem>

#include "core/parallel.h"
#include "core/random.h"
#include "core/sampling.h"
#include "scene/scene_file.h"
#include "support/oracle.h"
#include "support/scene_builder.h"

namespace brume {
namespace {

// A building of 20,000 triangles where the data is at hand, else a room with blocks.
Scene bench_scene() {
  Scene scene;
  const std::filesystem::path mesh =
      std::string(BRUME_SHARED_DATA) + "/meshes/medieval_building/Medieval_building.obj";
  if (std::filesystem::exists(mesh)) {
    const auto file = std::filesystem::temp_directory_path() / "brume_gather_bench.json";
    std::FILE* out = std::fopen(file.c_str(), "w");
    std::fprintf(out, R"({"version":1,"meshes":[{"file":"%s"}]})", mesh.c_str());
    std::fclose(out);
    scene = load_scene(file, {});
    std::filesystem::remove(file);
  } else {
    const auto grey = test::add_material(scene, test::diffuse(0.5f));
    test::add_room(scene, {Vec3d(-2), Vec3d(2)}, grey);
    for (int i = 0; i < 64; ++i)
      test::add_room(scene, {Vec3d(i % 4 - 1.9, i / 4 % 4 - 1.9, i / 16 - 1.9),
                             Vec3d(i % 4 - 1.6, i / 4 % 4 - 1.6, i / 16 - 1.6)}, grey);
  }
  return scene;
}

struct Points {
  Points() : lit(bench_scene()) {
    RandomStream random(1);
    const auto& meshes = lit.world.tracer().meshes();
    while (points.size() < 256) {
      const auto m = static_cast<std::uint32_t>(random.uniform() * double(meshes.size()));
      const auto t =
          static_cast<std::uint32_t>(random.uniform() * double(meshes[m].triangles.size()));
      const Hit hit = lit.world.tracer().point_on(m, t, sample_triangle(random.uniform2()));
      points.push_back({hit.position, hit.normal, hit.offset, random.bits()});
    }
  }
  test::LitWorld lit;
  std::vector<GatherPoint> points;
};

const Points& points() {
  static const Points p;
  return p;
}

constexpr int kTheta = 16, kPhi = 50;

void VacuumGather(benchmark::State& state) {
  flush_denormals();
  GatherOptions options;
  options.cells_theta = kTheta;
  options.cells_phi = kPhi;
  options.gradient = state.range(0) ? GradientMode::Full : GradientMode::None;
  Gatherer gatherer(points().lit.lighting, points().lit.effects, options);
  Counters counters;
  std::size_t i = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(gatherer.gather(points().points[i++ % points().points.size()],
                                             HitLight{.reflect = false}, counters));
  state.counters["rays"] = benchmark::Counter(double(counters.rays), benchmark::Counter::kIsRate);
}
BENCHMARK(VacuumGather)->Arg(0)->Arg(1)->ArgName("gradients")->MinTime(1);

// The tracer's own packets, hits rebuilt in double.
void TracerPackets(benchmark::State& state) {
  flush_denormals();
  std::vector<Ray> rays(kTheta * kPhi);
  std::vector<Hit> hits(rays.size());
  RandomStream random(2);
  std::size_t i = 0, traced = 0;
  for (auto _ : state) {
    state.PauseTiming();
    const GatherPoint& p = points().points[i++ % points().points.size()];
    const Frame frame(p.normal);
    for (std::size_t r = 0; r < rays.size(); ++r)
      rays[r] = {p.position + p.normal * p.offset,
                 frame.to_world(sample_cosine_hemisphere({(double(r) + 0.5) / double(rays.size()),
                                                          random.uniform()}))};
    state.ResumeTiming();
    points().lit.world.tracer().intersect(rays, hits);
    traced += rays.size();
  }
  state.counters["rays"] = benchmark::Counter(double(traced), benchmark::Counter::kIsRate);
}
BENCHMARK(TracerPackets)->MinTime(1);

// rtcIntersect8 alone: packets prepared beforehand, nothing done with the hits.
void BareIntersect8(benchmark::State& state) {
  flush_denormals();
  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  for (const TriangleMesh& mesh : points().lit.world.tracer().meshes()) {
    RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* v = static_cast<float*>(rtcSetNewGeometryBuffer(
        g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, mesh.positions.size()));
    for (const Vec3d& p : mesh.positions)
      for (int a = 0; a < 3; ++a) *v++ = static_cast<float>(p[a]);
    auto* t = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
        g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, mesh.triangles.size()));
    for (const auto& triangle : mesh.triangles)
      for (const std::uint32_t index : triangle) *t++ = index;
    rtcCommitGeometry(g);
    rtcAttachGeometry(scene, g);
    rtcReleaseGeometry(g);
  }
  rtcCommitScene(scene);
  std::vector<RTCRayHit8> packets(points().points.size() * kTheta * kPhi / 8);
  std::size_t next = 0;
  RandomStream random(2);
  for (const GatherPoint& p : points().points) {
    const Frame frame(p.normal);
    const Vec3d o = p.position + p.normal * (1e-4 * points().lit.world.diagonal());
    for (int r = 0; r < kTheta * kPhi; ++r, ++next) {
      const Vec3d d = frame.to_world(sample_cosine_hemisphere(
          {(r + 0.5) / (kTheta * kPhi), random.uniform()}));
      RTCRay8& ray = packets[next / 8].ray;
      const std::size_t lane = next % 8;
      ray.org_x[lane] = float(o.x), ray.org_y[lane] = float(o.y), ray.org_z[lane] = float(o.z);
      ray.dir_x[lane] = float(d.x), ray.dir_y[lane] = float(d.y), ray.dir_z[lane] = float(d.z);
      ray.tnear[lane] = 0, ray.mask[lane] = ~0u, ray.flags[lane] = 0, ray.time[lane] = 0;
    }
  }
  alignas(32) const int valid[8] = {-1, -1, -1, -1, -1, -1, -1, -1};
  std::size_t i = 0, traced = 0;
  for (auto _ : state) {
    RTCRayHit8 packet = packets[i++ % packets.size()];
    for (int lane = 0; lane < 8; ++lane) {
      packet.ray.tfar[lane] = std::numeric_limits<float>::infinity();
      packet.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
    }
#if defined(RTC_VERSION_MAJOR) && RTC_VERSION_MAJOR >= 4
    rtcIntersect8(valid, scene, &packet);
#else
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect8(valid, scene, &context, &packet);
#endif
    benchmark::DoNotOptimize(packet);
    traced += 8;
  }
  state.counters["rays"] = benchmark::Counter(double(traced), benchmark::Counter::kIsRate);
  rtcReleaseScene(scene);
  rtcReleaseDevice(device);
}
BENCHMARK(BareIntersect8)->MinTime(1);

// One record of a reference scene with everything on.
void MediumGather(benchmark::State& state) {
  flush_denormals();
  static const test::LitWorld lit(make_scene(oracle_scene("scatg", 0.05)), LightDepth::Volumes);
  GatherOptions options;
  options.gradient = state.range(0) ? GradientMode::Full : GradientMode::WardHeckbert;
  Gatherer gatherer(lit.lighting, lit.effects, options);
  Counters counters;
  std::uint64_t key = 0;
  for (auto _ : state)
    benchmark::DoNotOptimize(gatherer.gather({{-1, 0.25, 0}, {0, 0, 1}, 0, ++key},
                                             HitLight{.reflect = false}, counters));
  state.counters["rays"] = benchmark::Counter(double(counters.rays), benchmark::Counter::kIsRate);
  state.counters["segments"] =
      benchmark::Counter(double(counters.segments), benchmark::Counter::kIsRate);
}
BENCHMARK(MediumGather)->Arg(0)->Arg(1)->ArgName("full")->MinTime(1);

}  // namespace
}  // namespace brume

int main(int argc, char** argv) {
  if (const auto status = brume::run_grid_loader_child(argc, argv)) return *status;
  benchmark::Initialize(&argc, argv);
  benchmark::RunSpecifiedBenchmarks();
}
