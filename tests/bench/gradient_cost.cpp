// What media gradients cost over Ward-Heckbert's in the same bake (DESIGN 5: at most 4 %): the records of a
// bake gathered again in both modes, by turns. CPU seconds of one thread; a ratio of pairs, so it prints a
// table instead of using the benchmark library.
//
//   gradient_cost SCENE.json [pairs [records]]
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "bake/scene_settings.h"
#include "core/parallel.h"
#include "core/random.h"
#include "scene/scene_file.h"
#include "vdb_media/grid_file.h"

using namespace brume;

int main(int argc, char** argv) {
  if (const auto status = run_grid_loader_child(argc, argv)) return *status;
  flush_denormals();
  if (argc < 2) {
    std::fprintf(stderr, "usage: gradient_cost SCENE.json [pairs [records]]\n");
    return 2;
  }
  const int pairs = argc > 2 ? std::atoi(argv[2]) : 15;
  const std::size_t wanted = argc > 3 ? std::strtoul(argv[3], nullptr, 10) : 400;
  const Scene scene = load_scene(argv[1], {});
  const World world(scene);
  const BakeSettings settings = settings_of(scene.render);
  const Lighting lighting(world, {});
  BakeRequest request;
  request.deep_only = true;
  const BakeResult deeper = bake(lighting, settings, request, nullptr);
  const HitLight below = light_below(*deeper.cache, settings, world, 0);
  const Effects effects = plan_effects(world, settings.bounces, settings.volume_bounces);

  const auto records = deeper.cache->records();
  const std::size_t step = std::max<std::size_t>(1, records.size() / wanted);
  const auto seconds = [&](GradientMode mode) {
    GatherOptions options = settings.gather;
    options.gradient = mode;
    Gatherer gatherer(lighting, effects, options);
    Counters counters;
    const std::clock_t start = std::clock();
    for (std::size_t i = 0; i < records.size(); i += step) {
      const SurfaceRecord& r = records[i];
      const Vec3d n = Vec3d(r.normal[0], r.normal[1], r.normal[2]).normalized();
      const Vec3d p = Vec3d(r.position[0], r.position[1], r.position[2]) + deeper.cache->origin();
      gatherer.gather({p, n, 1e-5 * world.diagonal(), random_key(1, r.key)}, below, counters);
    }
    return double(std::clock() - start) / CLOCKS_PER_SEC;
  };
  std::vector<double> ratios;
  seconds(GradientMode::Full);  // Warms up.
  double total = 0;
  for (int i = 0; i < pairs; ++i) {
    // Which goes first alternates, so that a drifting machine favours neither.
    double ward, full;
    if (i % 2 == 0) {
      ward = seconds(GradientMode::WardHeckbert);
      full = seconds(GradientMode::Full);
    } else {
      full = seconds(GradientMode::Full);
      ward = seconds(GradientMode::WardHeckbert);
    }
    total += full;
    ratios.push_back(full / ward);
  }
  std::sort(ratios.begin(), ratios.end());
  // The median's 95 % interval by order statistics of 15: the 4th and the 12th.
  const std::size_t n = ratios.size();
  std::printf("%s: %zu gathers, %.2f ms each; full / ward-heckbert %.4f [%.4f, %.4f]\n", argv[1],
              (records.size() + step - 1) / step, 1e3 * total / pairs / double((records.size() + step - 1) / step),
              ratios[n / 2], ratios[n / 4], ratios[n - 1 - n / 4]);
}
