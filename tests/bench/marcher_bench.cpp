// Optical depth of whole rays: brume's marcher against OpenVDB's VolumeRayIntersector and NanoVDB's
// HDDA, all trilinear, all on the same values. The others take midpoint samples, at the coarsest
// step that reaches 1e-4 rms of the mean optical depth; brume has no step. brume marches with each
// instruction set that the CPU has.
//
// Prints the ratios first, from interleaved runs, as other work on the machine moves plain timings
// by more than the differences looked for; then the usual table per ray and per segment.
#include <benchmark/benchmark.h>
#include <nanovdb/util/HDDA.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <nanovdb/util/Ray.h>
#include <nanovdb/util/SampleFromVoxels.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/Morphology.h>
#include <openvdb/tools/RayIntersector.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <functional>
#include <string>

#include "core/parallel.h"
#include "core/random.h"
#include "core/sampling.h"
#include "support/instruction_sets.h"
#include "vdb_media/ray_marcher.h"

namespace {

using namespace brume;

constexpr int kRays = 4096;
constexpr double kTargetRms = 1e-4;

struct Case {
  std::string name;
  openvdb::FloatGrid::Ptr vdb;  // Dilated, so that its leaves cover all of the interpolant.
  nanovdb::GridHandle<> nano;
  Medium medium;
  std::vector<Ray> rays;
  std::vector<double> exact;  // Integrals of density.
  double mean = 0;
};

// A bent, lumpy plume of about `height` x `height` x `height` / 2 voxels.
openvdb::FloatGrid::Ptr generate(int height) {
  auto grid = openvdb::FloatGrid::create();
  grid->setTransform(openvdb::math::Transform::createLinearTransform(0.5));
  auto accessor = grid->getAccessor();
  const double scale = height / 220.0;
  const int width = height * 112 / 220;
  for (int z = 0; z < width; ++z)
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x) {
        const double radius = 18 * scale + 0.15 * y;
        const double a = (x - 56 * scale + 8 * scale * std::sin(0.05 * y / scale)) / radius,
                     b = (z - 56 * scale) / radius;
        const double d = 1 - a * a - b * b +
                         0.6 * std::sin(0.31 * x) * std::sin(0.27 * y + 1) * std::sin(0.35 * z + 2);
        if (d > 0.3) accessor.setValue({x, y, z}, float(d - 0.3));
      }
  return grid;
}

std::shared_ptr<const BrickGrid> to_bricks(const openvdb::FloatGrid& grid) {
  const openvdb::CoordBBox box = grid.evalActiveVoxelBoundingBox();
  openvdb::tools::Dense<float, openvdb::tools::LayoutXYZ> dense(box);
  openvdb::tools::copyToDense(grid, dense);
  const auto dim = box.dim();
  std::vector<float> values(dense.data(), dense.data() + dense.valueCount());
  Affine3d map;
  const openvdb::Mat4R m = grid.transform().baseMap()->getAffineMap()->getMat4();
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) map.m[i][j] = m(j, i);
  return BrickGrid::from_dense(Vec3i(box.min().x(), box.min().y(), box.min().z()),
                               Vec3i(dim.x(), dim.y(), dim.z()), values, map);
}

double brume_integral(const Case& c, std::size_t ray, MarchCounters& counters) {
  return density_integral(c.medium.volumes()[0], c.rays[ray], {}, {}, counters);
}

Case make_case(const std::string& name, openvdb::FloatGrid::Ptr grid) {
  Case c;
  c.name = name;
  grid->tree().voxelizeActiveTiles();
  Volume volume;
  volume.density = to_bricks(*grid);
  volume.sigma_a = RgbD(1.0);
  c.medium = Medium({volume});
  openvdb::tools::dilateActiveValues(grid->tree(), 1, openvdb::tools::NN_FACE_EDGE_VERTEX,
                                     openvdb::tools::IGNORE_TILES);
  c.vdb = grid;
  c.nano = nanovdb::openToNanoVDB(*grid);

  RandomStream random(random_key(77));
  const Box3d box = c.medium.bounds();
  const Vec3d size = box.max - box.min;
  while (c.rays.size() < kRays) {
    const Vec3d target =
        box.min + size * Vec3d(random.uniform(), random.uniform(), random.uniform());
    const Vec3d origin = box.center() + sample_sphere(random.uniform2()) * (0.6 * size.length());
    c.rays.push_back({origin, (target - origin).normalized()});
  }
  MarchCounters counters;
  for (std::size_t i = 0; i < c.rays.size(); ++i) {
    c.exact.push_back(brume_integral(c, i, counters));
    c.mean += c.exact.back() / kRays;
  }
  return c;
}

// Midpoints of equal steps, at most `step` long.
template <typename Sample>
double sum_span(double t0, double t1, double step, Sample&& sample) {
  const int n = std::max(1, int(std::ceil((t1 - t0) / step)));
  const double h = (t1 - t0) / n;
  double sum = 0;
  for (int i = 0; i < n; ++i) sum += sample(t0 + (i + 0.5) * h);
  return sum * h;
}

class OpenVdbMarcher {
 public:
  explicit OpenVdbMarcher(const Case& c)
      : intersector_(*c.vdb), accessor_(c.vdb->getConstAccessor()), case_(c) {}

  double integral(std::size_t ray, double step) {
    const Ray& r = case_.rays[ray];
    const openvdb::math::Ray<double> world({r.origin.x, r.origin.y, r.origin.z},
                                           {r.direction.x, r.direction.y, r.direction.z});
    const auto index = world.worldToIndex(*case_.vdb);
    if (!intersector_.setIndexRay(index)) return 0;
    double sum = 0, t0 = 0, t1 = 0;
    while (intersector_.march(t0, t1))
      sum += sum_span(t0, t1, step, [&](double t) {
        return openvdb::tools::BoxSampler::sample(accessor_, index(t));
      });
    return sum * case_.vdb->voxelSize()[0];
  }

 private:
  openvdb::tools::VolumeRayIntersector<openvdb::FloatGrid> intersector_;
  openvdb::FloatGrid::ConstAccessor accessor_;
  const Case& case_;
};

class NanoVdbMarcher {
 public:
  explicit NanoVdbMarcher(const Case& c)
      : grid_(*c.nano.grid<float>()), accessor_(grid_.getAccessor()), case_(c) {}

  double integral(std::size_t ray, double step) {
    using Vec = nanovdb::Vec3<float>;
    const Ray& r = case_.rays[ray];
    // Index space with a unit direction; the origin is moved near the grid as floats are short.
    const Affine3d& map = case_.medium.volumes()[0].density->world_to_index();
    const double voxel = case_.medium.voxel_size();
    const Vec3d o = map.point(r.origin), d = map.vector(r.direction) * voxel;
    const nanovdb::Ray<float> index(Vec(float(o.x), float(o.y), float(o.z)),
                                    Vec(float(d.x), float(d.y), float(d.z)));
    nanovdb::TreeMarcher<nanovdb::LeafNode<float>, nanovdb::Ray<float>, decltype(accessor_)>
        marcher(accessor_);
    if (!marcher.init(index)) return 0;
    auto sampler = nanovdb::createSampler<1>(accessor_);
    const nanovdb::LeafNode<float>* leaf = nullptr;
    float t0 = 0, t1 = 0;
    double sum = 0;
    while (marcher.step(&leaf, t0, t1))
      sum += sum_span(t0, t1, step, [&](double t) { return sampler(index(float(t))); });
    return sum * voxel;
  }

 private:
  const nanovdb::FloatGrid& grid_;
  nanovdb::DefaultReadAccessor<float> accessor_;
  const Case& case_;
};

// rms of the error over the mean integral.
template <typename Marcher>
double rms(const Case& c, Marcher& marcher, double step) {
  double squares = 0;
  for (std::size_t i = 0; i < c.rays.size(); ++i) {
    const double error = marcher.integral(i, step) - c.exact[i];
    squares += error * error;
  }
  return std::sqrt(squares / double(c.rays.size())) / c.mean;
}

// The coarsest step that reaches the target, to 10 %; the finest tried where none does.
template <typename Marcher>
double coarsest_step(const Case& c, Marcher& marcher, const char* name) {
  double step = 4;
  while (step > 0.02 && rms(c, marcher, step) > kTargetRms) step /= 1.1;
  std::printf("%-10s %-8s step %.3f voxels, rms %.2e of the mean\n", c.name.c_str(), name, step,
              rms(c, marcher, step));
  return step;
}

double cpu_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

double seconds(const std::function<double(std::size_t)>& integral) {
  const double start = cpu_seconds();
  double sum = 0;
  for (std::size_t i = 0; i < kRays; ++i) sum += integral(i);
  benchmark::DoNotOptimize(sum);
  return cpu_seconds() - start;
}

double median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + v.size() / 2, v.end());
  return v[v.size() / 2];
}

void print_ratios(const Case& c) {
  OpenVdbMarcher open(c);
  NanoVdbMarcher nano(c);
  const double open_step = coarsest_step(c, open, "OpenVDB"),
               nano_step = coarsest_step(c, nano, "NanoVDB");
  MarchCounters counters;
  struct Marcher {
    std::string name;
    std::int64_t set;
    std::function<double(std::size_t)> integral;
    std::vector<double> times;
  };
  const auto brume = [&](std::size_t i) { return brume_integral(c, i, counters); };
  std::vector<Marcher> marchers{
      {"OpenVDB", 0, [&](std::size_t i) { return open.integral(i, open_step); }, {}},
      {"NanoVDB", 0, [&](std::size_t i) { return nano.integral(i, nano_step); }, {}}};
  for (const std::int64_t set : kInstructionSets)
    if (UseInstructionSet::is_here(set)) marchers.push_back({hwy::TargetName(set), set, brume, {}});
  for (int run = 0; run < 15; ++run)
    for (Marcher& m : marchers) {
      const UseInstructionSet use(m.set);
      m.times.push_back(seconds(m.integral));
    }
  // Each run's own ratio, then the middle one: what slows the machine slows both.
  const auto ratio = [&](const Marcher& slow, const Marcher& fast) {
    std::vector<double> r;
    for (std::size_t i = 0; i < slow.times.size(); ++i) r.push_back(slow.times[i] / fast.times[i]);
    return median(r);
  };
  for (const Marcher& m : marchers)
    std::printf("%-10s %-8s %8.0f rays/s, times NanoVDB %.2f, times OpenVDB %.2f\n", c.name.c_str(),
                m.name.c_str(), kRays / median(m.times), ratio(marchers[1], m),
                ratio(marchers[0], m));
}

void report(benchmark::State& state, const MarchCounters& counters) {
  state.counters["rays/s"] = benchmark::Counter(double(counters.rays), benchmark::Counter::kIsRate);
  state.counters["segments/s"] =
      benchmark::Counter(double(counters.segments), benchmark::Counter::kIsRate);
}

void optical_depths(benchmark::State& state, const Case& c, std::int64_t set) {
  const UseInstructionSet use(set);
  MarchCounters counters;
  std::size_t i = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(brume_integral(c, i, counters));
    i = (i + 1) % kRays;
  }
  report(state, counters);
}

void shells(benchmark::State& state, const Case& c, std::int64_t set, bool gradients) {
  const UseInstructionSet use(set);
  const int count = int(state.range(0));
  const double length = 1.2 * (c.medium.bounds().max - c.medium.bounds().min).length();
  std::vector<double> edges, jitter(count, 0.37);
  for (int i = 0; i <= count; ++i) edges.push_back(length * i / count);
  ShellMarcher marcher(c.medium, {});
  MarchCounters counters;
  std::size_t i = 0;
  for (auto _ : state) {
    marcher.march(c.rays[i], edges, kInfinity, jitter, gradients, counters);
    benchmark::DoNotOptimize(marcher.tau(count));
    i = (i + 1) % kRays;
  }
  report(state, counters);
}

void register_case(const Case& c) {
  for (const std::int64_t set : kInstructionSets) {
    if (!UseInstructionSet::is_here(set)) continue;
    const std::string name = hwy::TargetName(set);
    benchmark::RegisterBenchmark((c.name + "/optical_depth/" + name).c_str(), optical_depths,
                                 std::cref(c), set);
    for (const bool gradients : {false, true})
      benchmark::RegisterBenchmark(
          (c.name + (gradients ? "/shells_gradients/" : "/shells/") + name).c_str(), shells,
          std::cref(c), set, gradients)
          ->Arg(32)
          ->Arg(96);
  }
}

}  // namespace

int main(int argc, char** argv) {
  brume::flush_denormals();
  openvdb::initialize();
  benchmark::Initialize(&argc, argv);
  std::vector<std::unique_ptr<Case>> cases;
  const auto add = [&](const std::string& name, openvdb::FloatGrid::Ptr grid) {
    cases.push_back(std::make_unique<Case>(make_case(name, std::move(grid))));
    print_ratios(*cases.back());
    register_case(*cases.back());
  };
  add("generated", generate(220));
  add("plume_512", generate(512));
  for (const char* name : {"smoke1", "wdas_cloud_sixteenth", "teapot_cloud"}) {
    const std::filesystem::path path =
        std::filesystem::path(BRUME_SHARED_DATA) / "vdb" / (std::string(name) + ".vdb");
    if (!std::filesystem::exists(path)) {
      std::printf("%s is not there.\n", path.c_str());
      continue;
    }
    openvdb::io::File file(path.string());
    file.open();
    add(name, openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("density")));
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
