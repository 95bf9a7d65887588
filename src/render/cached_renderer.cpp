#include "render/cached_renderer.h"

#include <atomic>

#include "core/parallel.h"
#include "core/random.h"
#include "gather/medium_source.h"
#include "gather/surface_light.h"
#include "render/picture_irradiance.h"
#include "render/sample_points.h"

namespace brume {
namespace {

// Decisions with well-spread numbers of their own; shells and lights count on from theirs.
enum Dimension : std::uint32_t { kPixel, kShell = 16, kSurfaceLight = 1024 };

constexpr int kTilePixels = 16;

// Renders pixels on one thread.
class PixelRenderer {
 public:
  PixelRenderer(const Lighting& lighting, const BakeSettings& settings, const IrradianceCache& cache,
                const HitLight& below, const CameraRays& camera, const CachedRenderOptions& options)
      : lighting_(lighting), world_(lighting.world()), settings_(settings),
        camera_(camera), options_(options),
        effects_(plan_effects(world_, settings.bounces, settings.volume_bounces)),
        marcher_(world_.medium(), march_options()), source_(lighting, effects_),
        hit_light_(lighting), below_(below),
        irradiance_(lighting, effects_, settings, cache, below) {
    source_.use_scattered(below_.scattered.get());
  }

  PixelResult pixel(int x, int y);

  Counters counters;

 private:
  MarchOptions march_options() const {
    MarchOptions m = lighting_.march();
    if (options_.step_voxels > 0) m.step_voxels = options_.step_voxels;
    return m;
  }
  // Returns whether a surface was hit.
  bool sample(const Ray& ray, const SamplePoints& points, std::uint64_t key, PixelResult& result);
  RgbD march_eye_ray(const Ray& ray, double t_end, const SamplePoints& points,
                     RandomStream& random, PixelResult& result);
  void shade(const Hit& hit, const Ray& ray, const RgbD& reaching, const SamplePoints& points,
             RandomStream& random, std::uint64_t key, PixelResult& result);
  RgbD indirect(const Hit& hit, const Vec3d& n, double footprint, std::uint64_t key,
                PixelResult& result);
  RgbD glossy_indirect(const Vec3d& p, const Vec3d& n, const Vec3d& wo, const Material& material,
                       const SamplePoints& points, RandomStream& random);

  const Lighting& lighting_;
  const World& world_;
  const BakeSettings& settings_;
  const CameraRays& camera_;
  const CachedRenderOptions& options_;
  Effects effects_;
  ShellMarcher marcher_;
  MediumSource source_;
  SurfaceLight hit_light_;
  const HitLight& below_;
  PictureIrradiance irradiance_;
  std::vector<double> boundaries_, jitter_;
  std::vector<float> shifts_;  // The same.
};

// Single scattering and emission along the ray, stratified in shells; returns its transmittance.
RgbD PixelRenderer::march_eye_ray(const Ray& ray, double t_end, const SamplePoints& points,
                                  RandomStream& random, PixelResult& result) {
  const Medium& medium = world_.medium();
  MarchCounters march;
  RgbD reaching(1);
  const Interval inside = clip(ray, medium.bounds(), {0, t_end});
  if (inside.is_empty()) return reaching;
  if (!effects_.scattering && !effects_.emission && !below_.scattered) {
    reaching = exp_neg(optical_depth(medium, ray, {0, t_end}, march_options(), march));
  } else {
    double end = inside.end;
    if (!(end < kInfinity)) {
      const double sigma = max_component(medium.sigma_t_at(ray.origin));
      end = inside.begin + (sigma > 0 ? 50 / sigma : world_.diagonal());
    }
    boundaries_.clear();
    jitter_.clear();
    for (int i = 0; i <= options_.eye_shells; ++i)
      boundaries_.push_back(inside.begin + (end - inside.begin) * i / options_.eye_shells);
    for (int i = 0; i < options_.eye_shells; ++i)
      jitter_.push_back(points.square(kShell + static_cast<std::uint32_t>(i)).x);
    shifts_.assign(jitter_.begin(), jitter_.end());
    marcher_.march(ray, boundaries_, t_end, jitter_, false, march);
    const MarchedShells marched = marcher_.view();
    source_.begin();
    const int added =
        source_.add(marched, ray, boundaries_, t_end, {shifts_}, random);
    source_.finish(counters);
    for (const MediumLight& part : source_.light(added))
      switch (part.kind) {
        case MediumLight::Kind::Direct:
          result[Layer::VolumeDirect] += part.light;
          break;
        case MediumLight::Kind::Rescattered:
          result[Layer::VolumeIndirect] += part.light;
          break;
        case MediumLight::Kind::Emitted:
          result[Layer::VolumeEmission] += part.light;
      }
    reaching = exp_neg(marcher_.tau(marcher_.shell_count()));
  }
  counters.march_rays += march.rays;
  counters.segments += march.segments;
  return reaching;
}

RgbD PixelRenderer::indirect(const Hit& hit, const Vec3d& n, double footprint, std::uint64_t key,
                             PixelResult& result) {
  if (!effects_.indirect) return {};
  if (options_.gather_everywhere) return irradiance_.gather(hit, n, key, counters);
  const InterpolatedIrradiance e =
      irradiance_.answer(hit, n, footprint, options_.gather_fallback, key, counters);
  result.cache_count += e.records;
  return e.irradiance;
}

// One ray by the glossy lobe; what it hits is lit directly and by the records, as eyes see it.
RgbD PixelRenderer::glossy_indirect(const Vec3d& p, const Vec3d& n, const Vec3d& wo,
                                    const Material& material, const SamplePoints& points,
                                    RandomStream& random) {
  const BrdfSample lobe = sample_specular(material, n, wo, random.uniform2());
  if (!(lobe.pdf > 0) || is_black(lobe.weight)) return {};
  const Ray ray{p, lobe.wi};
  const Hit hit = world_.tracer().intersect(ray);
  ++counters.rays;
  PixelResult seen;  // Collects the medium's light along the way.
  const RgbD reaching = march_eye_ray(ray, hit.t, points, random, seen);
  RgbD light =
      seen[Layer::VolumeDirect] + seen[Layer::VolumeIndirect] + seen[Layer::VolumeEmission];
  if (hit.is_hit()) {
    hit_light_.begin(1, RandomStream(random.bits()));
    constexpr double kSpread = 1.0 / 16;  // Of one of a lobe's rays.
    hit_light_.add(0, hit, ray.direction, kSpread * hit.t, below_, counters);
    hit_light_.finish(counters);
    light += hit_light_.radiance(0) * reaching;
  }
  return light * lobe.weight;
}

void PixelRenderer::shade(const Hit& hit, const Ray& ray, const RgbD& reaching,
                          const SamplePoints& points, RandomStream& random, std::uint64_t key,
                          PixelResult& result) {
  const Material& material = world_.material(hit);
  const Vec3d wo = -ray.direction;
  result[Layer::Emission] += world_.emission(hit, wo) * reaching;
  const bool front = hit.normal.dot(ray.direction) < 0;
  const Vec3d n = front ? hit.shading_normal : -hit.shading_normal;
  const Vec3d ng = front ? hit.normal : -hit.normal;
  const Vec3d p = hit.spawn(wo);
  result.normal += n;
  result.position += hit.position;
  result.albedo += RgbD(material.albedo);
  if (!material.reflects()) return;

  for (std::size_t l = 0; l < world_.lights().size(); ++l) {
    const LightSample s = world_.lights()[l]->sample(
        p, points.square(kSurfaceLight + static_cast<std::uint32_t>(l)));
    const double cosine = n.dot(s.direction);
    if (cosine <= 0 || ng.dot(s.direction) <= 0 || is_black(s.weight)) continue;
    ++counters.shadow_rays;
    if (world_.tracer().is_occluded(shadow_ray(p, s))) continue;
    // Marched: shadows of smoke are sharp to the eye, and this is one ray a light, not one a shell.
    const RgbD incident =
        s.weight * reaching * cosine * lighting_.exact_transmittance(s, p, counters);
    result[Layer::DiffuseDirect] += incident * RgbD(material.albedo) * kInvPi;
    if (material.is_glossy())
      result[Layer::GlossyDirect] += incident * eval_specular(material, n, s.direction, wo);
  }
  const double footprint = kFootprintPixels * camera_.pixel_angle() * hit.t;
  if (!is_black(material.albedo))
    result[Layer::DiffuseIndirect] += indirect(hit, n, footprint, key, result) *
                                      RgbD(material.albedo) * kInvPi * reaching;
  if (material.is_glossy() && effects_.indirect)
    result[Layer::GlossyIndirect] += glossy_indirect(p, n, wo, material, points, random) * reaching;
}

bool PixelRenderer::sample(const Ray& ray, const SamplePoints& points, std::uint64_t key,
                           PixelResult& result) {
  RandomStream random(key);
  const Hit hit = world_.tracer().intersect(ray);
  ++counters.rays;
  const RgbD reaching = effects_.medium ? march_eye_ray(ray, hit.t, points, random, result) : RgbD(1);
  result.transmittance += reaching;
  if (!hit.is_hit()) {
    result[Layer::Background] += world_.background(ray.direction) * reaching;
    result.alpha += 1 - mean_component(reaching);
    return false;
  }
  result.alpha += 1;
  result.z = std::min(result.z, hit.t * ray.direction.dot(camera_.forward()));
  shade(hit, ray, reaching, points, random, random_key(key, 1), result);
  return true;
}

PixelResult PixelRenderer::pixel(int x, int y) {
  PixelResult sum;
  sum.transmittance = RgbD();
  sum.z = kInfinity;
  const std::uint64_t before = counters.rays + counters.shadow_rays + counters.medium_shadow_rays +
                               counters.segments;
  const int n = std::max(1, options_.samples);
  int hits = 0;
  const std::uint64_t pixel_key = random_key(settings_.seed, 0x706978ULL, x, y);
  for (int i = 0; i < n; ++i) {
    const SamplePoints points(pixel_key, static_cast<std::uint32_t>(i));
    const Vec2d u = points.square(kPixel);
    hits += sample(camera_.ray(x + u.x, y + u.y), points, random_key(pixel_key, i), sum);
  }
  for (RgbD& layer : sum.layers) layer *= 1.0 / n;
  sum.alpha /= n;
  if (sum.normal.length2() > 0) sum.normal.normalize();
  if (hits > 0) sum.position /= hits;
  sum.albedo *= 1.0 / n;
  sum.transmittance *= 1.0 / n;
  sum.cache_count /= n;
  sum.cost = double(counters.rays + counters.shadow_rays + counters.medium_shadow_rays +
                    counters.segments - before) / n;
  return sum;
}

}  // namespace

CachedRenderResult render_cached(const Lighting& lighting, const BakeSettings& settings,
                                 const IrradianceCache& cache, const CameraRays& camera,
                                 const CachedRenderOptions& options, PixelFilm& film) {
  const int x0 = static_cast<int>(std::floor(options.crop_x.begin * film.width()));
  const int x1 = static_cast<int>(std::ceil(options.crop_x.end * film.width()));
  const int y0 = static_cast<int>(std::floor(options.crop_y.begin * film.height()));
  const int y1 = static_cast<int>(std::ceil(options.crop_y.end * film.height()));
  const int tiles_x = (x1 - x0 + kTilePixels - 1) / kTilePixels;
  const int tiles_y = (y1 - y0 + kTilePixels - 1) / kTilePixels;

  const HitLight below =
      light_below(cache, settings, lighting.world(), options.threads, options.scattered);
  std::vector<std::unique_ptr<PixelRenderer>> renderers(
      static_cast<std::size_t>(resolve_thread_count(options.threads)));
  std::atomic<std::size_t> done = 0;
  std::atomic<bool> stopped = false;
  const std::size_t tiles = std::size_t(tiles_x) * tiles_y;
  parallel_for_slots(options.threads, tiles, 1, [&](std::size_t tile, int slot) {
    if (stopped || (options.stop_requested && options.stop_requested())) {
      stopped = true;
      return;
    }
    if (!renderers[slot])
      renderers[slot] =
          std::make_unique<PixelRenderer>(lighting, settings, cache, below, camera, options);
    const int tx = x0 + static_cast<int>(tile % tiles_x) * kTilePixels;
    const int ty = y0 + static_cast<int>(tile / tiles_x) * kTilePixels;
    for (int y = ty; y < std::min(ty + kTilePixels, y1); ++y)
      for (int x = tx; x < std::min(tx + kTilePixels, x1); ++x)
        film.at(x, y) = renderers[slot]->pixel(x, y);
    if (options.progress) options.progress(double(++done) / double(tiles));
  });
  CachedRenderResult result;
  for (const auto& r : renderers)
    if (r) result.counters += r->counters;
  result.is_stopped = stopped;
  return result;
}

}  // namespace brume
