#include "render/irradiance_paths.h"

#include "core/random.h"

namespace brume {
namespace {

PathTracerOptions options_of(const BakeSettings& settings) {
  PathTracerOptions options;
  options.transport = Transport::Cached;
  options.bounces = settings.bounces;
  options.volume_bounces = settings.volume_bounces;
  return options;
}

}  // namespace

IrradiancePaths::IrradiancePaths(const World& world, const BakeSettings& settings)
    : options_(options_of(settings)), paths_(world, options_) {}

void IrradiancePaths::follow(const Hit& hit, const Vec3d& normal, std::uint64_t key, int count,
                             TracedIrradiance& traced) {
  for (; traced.paths < count; ++traced.paths) {
    const int half = traced.paths % 2;
    const SamplePoints spread(random_key(key, half), static_cast<std::uint32_t>(traced.paths / 2));
    RandomStream random(random_key(key, half, traced.paths));
    const double e = luminance(paths_.indirect_irradiance(hit, normal, spread.square(0), random));
    traced.half[half] += e;
    traced.squares += e * e;
  }
}

}  // namespace brume
