#include "render/reference_paths.h"

#include "core/sampling.h"

namespace brume {
namespace {

// Decisions with well-spread numbers of their own.
enum Dimension : std::uint32_t {
  kPixel,
  kDiffuseRay,
  kGlossyRay,
  kPhaseRay,
  kScatterLight = 8,
  kSurfaceLight = 16
};

// Up to this many lights the eye's vertex sends a shadow ray to each.
constexpr std::size_t kEachLight = 4;
// Up to this many samples of lights compete for a vertex's one shadow ray.
constexpr std::size_t kCandidates = 16;
// Within this share of the medium's diagonal around a point light, 1/r^2 is sampled by itself.
constexpr double kSingularShare = 0.1;

// Paths without a limit play Russian roulette from this vertex on, and never live for certain from
// the next on: albedo may be 1 in a closed room. The walk out of dense white smoke takes
// hundreds of vertices: dying faster than it ends makes the variance infinite, so mortality is late
// and slight.
constexpr int kRouletteFrom = 4, kMortalFrom = 1024;
constexpr double kMortalSurvival = 0.999, kLeastSurvival = 0.05;

bool is_singular(const Light& light) {
  return light.kind() == Light::Kind::Point || light.kind() == Light::Kind::Spot;
}

// Balance heuristic for a sample of density `own`; the other way of sampling may not exist (0).
double balance(double own, double other) { return own > 0 && other > 0 ? own / (own + other) : 1; }

// False: the path ends.
bool play_roulette(int vertex, RgbD& weight, RandomStream& random) {
  if (vertex < kRouletteFrom) return true;
  const double survival = std::clamp(max_component(weight), kLeastSurvival,
                                     vertex < kMortalFrom ? 1 : kMortalSurvival);
  if (random.uniform() >= survival) return false;
  weight *= 1 / survival;
  return true;
}

}  // namespace

// A hit seen from `wo`; normals are turned to that side.
struct ReferencePaths::Surface {
  const Hit* hit = nullptr;
  const Material* material = nullptr;
  Vec3d normal{0.0}, shading_normal{0.0}, wo{0.0};

  // Directions through the surface that only the interpolated normal takes for reflections carry
  // nothing.
  // Clear of the surface. Lights are sampled from here: from the hit itself, a lamp close behind a
  // grazing ray would shadow its own samples.
  Vec3d point() const { return hit->position + normal * hit->offset; }
  double cosine(const Vec3d& wi) const {
    return normal.dot(wi) > 0 ? std::max(0.0, shading_normal.dot(wi)) : 0;
  }
  RgbD diffuse(double cosine) const { return RgbD(material->albedo) * (kInvPi * cosine); }
  RgbD glossy(const Vec3d& wi, double cosine) const {
    return eval_specular(*material, shading_normal, wi, wo) * cosine;
  }
};

ReferencePaths::ReferencePaths(const World& world, const PathTracerOptions& options)
    : world_(world), options_(options), tracker_(world.medium()) {
  const Medium& medium = world.medium();
  if (medium.scatters()) {
    const double medium_diagonal =
        medium.is_unbounded() ? kInfinity : (medium.bounds().max - medium.bounds().min).length();
    const double scene_diagonal = world.bounds().isEmpty() ? kInfinity : world.diagonal();
    const double extent = std::min(medium_diagonal, scene_diagonal);
    singular_radius_ = std::isfinite(extent) ? kSingularShare * extent : 1;
    Box3d reach = medium.bounds();
    reach.min -= Vec3d(singular_radius_);
    reach.max += Vec3d(singular_radius_);
    for (std::size_t i = 0; i < world.lights().size(); ++i) {
      const Light& light = *world.lights()[i];
      if (is_singular(light) && reach.intersects(light.centre()))
        singular_lights_.push_back({int(i), light.centre()});
    }
  }
  double sum = 0;
  for (const auto& light : world.lights())
    light_cdf_.push_back(sum += std::max(0.0, light->importance()));
}

Hit ReferencePaths::intersect(const Ray& ray) {
  ++rays_;
  return world_.tracer().intersect(ray);
}

ReferencePaths::Surface ReferencePaths::surface_at(const Hit& hit, const Vec3d& wo) const {
  const double side = hit.normal.dot(wo) >= 0 ? 1 : -1;
  Surface s{&hit, &world_.material(hit), hit.normal * side, hit.shading_normal * side, wo};
  // Near silhouettes an interpolated normal may face away from the viewer.
  if (s.shading_normal.dot(wo) <= 0) s.shading_normal = s.normal;
  return s;
}

RgbD ReferencePaths::visibility(const Vec3d& origin, const LightSample& sample,
                                RandomStream& random) {
  ++rays_;
  if (world_.tracer().is_occluded({origin, sample.direction, sample.distance})) return {};
  return tracker_.transmittance({origin, sample.direction}, sample.distance, random);
}

// Share of a point light's scattering at p that glow() answers for: 1 at the light and smoothly 0
// at the radius, so that what is left to collisions is bounded.
double ReferencePaths::near_share(int light, const Vec3d& p) const {
  for (const SingularLight& s : singular_lights_) {
    if (s.light != light) continue;
    const double x = (p - s.position).length2() / (singular_radius_ * singular_radius_);
    return x < 1 ? (1 - x) * (1 - x) : 0;
  }
  return 0;
}

template <typename Eval>
ReferencePaths::Reflected ReferencePaths::direct_light(const Vec3d& p, bool in_medium,
                                                       const Eval& eval,
                                                       const SamplePoints* points,
                                                       RandomStream& random) {
  Reflected result;
  const auto& lights = world_.lights();
  if (lights.empty()) return result;
  const bool all = lights.size() <= kCandidates;
  const bool each = points && lights.size() <= kEachLight;
  const std::size_t count = all ? lights.size() : kCandidates;
  if (!all && !(light_cdf_.back() > 0)) return result;

  LightSample chosen;
  Reflected chosen_value;
  double total = 0, chosen_q = 0;
  for (std::size_t k = 0; k < count; ++k) {
    std::size_t i = k;
    double share = 1;  // How often this light is looked at.
    if (!all) {
      const double u = (k + random.uniform()) / count * light_cdf_.back();
      i = std::min<std::size_t>(
          std::upper_bound(light_cdf_.begin(), light_cdf_.end(), u) - light_cdf_.begin(),
          lights.size() - 1);
      share = count * (light_cdf_[i] - (i ? light_cdf_[i - 1] : 0)) / light_cdf_.back();
    }
    const Vec2d u =
        points ? points->square((in_medium ? kScatterLight : kSurfaceLight) + std::uint32_t(k))
               : random.uniform2();
    const LightSample sample = lights[i]->sample(p, u);
    if (is_black(sample.weight)) continue;
    const Lobes lobes = eval(sample.direction);
    Reflected value;
    double factor = 1 / share;
    if (in_medium) factor *= 1 - near_share(int(i), p);
    for (int l = 0; l < 2; ++l)
      value.value[l] =
          lobes.value[l] * sample.weight * (factor * balance(sample.pdf, lobes.pdf[l]));
    const double q = mean_component(value.sum());
    if (!(q > 0)) continue;
    if (each) {
      const RgbD visible = visibility(p, sample, random);
      for (int l = 0; l < 2; ++l) result.value[l] += value.value[l] * visible;
      continue;
    }
    total += q;
    if (random.uniform() * total < q) {
      chosen = sample;
      chosen_value = value;
      chosen_q = q;
    }
  }
  if (chosen_q > 0) {
    const RgbD visible = visibility(p, chosen, random) * (total / chosen_q);
    for (int l = 0; l < 2; ++l) result.value[l] = chosen_value.value[l] * visible;
  }
  return result;
}

RgbD ReferencePaths::direct_in_medium(const Vec3d& p, const Vec3d& direction, int volume,
                                      bool goes_on, const SamplePoints* points,
                                      RandomStream& random) {
  const HenyeyGreenstein& phase = world_.medium().volumes()[volume].phase;
  return direct_light(
             p, true,
             [&](const Vec3d& wi) {
               // Light travels along -wi and leaves along -direction; p depends on the angle alone.
               const double value = phase.eval(direction, wi);
               return Lobes{{RgbD(value), {}}, {goes_on ? value : 0, 0}};
             },
             points, random)
      .value[0];
}

RgbD ReferencePaths::direct_on_surface(const Surface& s, RandomStream& random) {
  return direct_light(
             s.point(), false,
             [&](const Vec3d& wi) {
               const double cosine = s.cosine(wi);
               if (!(cosine > 0)) return Lobes{};
               return Lobes{{s.diffuse(cosine) + s.glossy(wi, cosine), {}},
                            {pdf_brdf(*s.material, s.shading_normal, wi, s.wo), 0}};
             },
             nullptr, random)
      .value[0];
}

// Single scattering of point lights close to the ray, at distances drawn in proportion to 1/r^2
// [KF12].
RgbD ReferencePaths::glow(const Ray& ray, double t_end, RandomStream& random) {
  RgbD sum;
  for (const SingularLight& singular : singular_lights_) {
    const Vec3d to_light = singular.position - ray.origin;
    const double t_closest = to_light.dot(ray.direction),
                 radius2 = singular_radius_ * singular_radius_;
    const double closest2 = (to_light - ray.direction * t_closest).length2();
    if (!(closest2 < radius2)) continue;
    const double half = std::sqrt(radius2 - closest2);
    const double t0 = std::max(0.0, t_closest - half), t1 = std::min(t_end, t_closest + half);
    if (!(t0 < t1)) continue;
    const double closest = std::max(std::sqrt(closest2), 1e-9 * singular_radius_);
    const double a0 = std::atan2(t0 - t_closest, closest), a1 = std::atan2(t1 - t_closest, closest);
    const double s = closest * std::tan(a0 + (a1 - a0) * random.uniform());
    const double t = std::clamp(t_closest + s, t0, t1);
    const double inverse_pdf = (a1 - a0) * (closest * closest + s * s) / closest;
    const Vec3d p = ray.at(t);
    const LightSample sample = world_.lights()[singular.light]->sample(p, {0.5, 0.5});
    if (is_black(sample.weight)) continue;
    const ScatterPoint scatter = tracker_.scatter_at(p, random.uniform());
    if (!scatter.is_set) continue;
    const RgbD visible = visibility(p, sample, random);
    if (is_black(visible)) continue;
    const double phase =
        world_.medium().volumes()[scatter.volume].phase.eval(ray.direction, sample.direction);
    sum += scatter.weight * sample.weight * visible * tracker_.transmittance(ray, t, random) *
           (phase * inverse_pdf * near_share(singular.light, p));
  }
  return sum;
}

// Light of a sampled emitter that a drawn ray happens to hit.
RgbD ReferencePaths::emitter_hit(const Hit& hit, const DrawnRay& drawn) const {
  const int light = world_.light_at(hit);
  if (light < 0) return {};
  const RgbD emitted = world_.emission(hit, -drawn.ray.direction);
  if (is_black(emitted)) return {};
  const double t = (hit.position - drawn.from).dot(drawn.ray.direction);
  return emitted * balance(drawn.pdf, world_.lights()[light]->pdf(drawn.from, drawn.ray.direction,
                                                                  t, hit.normal));
}

RgbD ReferencePaths::environment_hit(const DrawnRay& drawn) const {
  RgbD sum;
  for (const int i : world_.environment_lights()) {
    const Light& light = *world_.lights()[i];
    sum += light.radiance(drawn.ray.direction) *
           balance(drawn.pdf, light.pdf(drawn.from, drawn.ray.direction, kInfinity, Vec3d(0.0)));
  }
  return sum;
}

PixelResult ReferencePaths::trace(const Ray& ray, const SamplePoints& points,
                                  RandomStream& random) {
  PixelResult result;
  const bool is_full = options_.transport == Transport::Full;
  const std::uint64_t cost_before = rays() + lookups();
  const Hit hit = intersect(ray);
  const Sweep sweep = tracker_.sweep(ray, hit.t, RgbD(1.0), random);
  result.transmittance = sweep.transmittance;
  result[Layer::VolumeEmission] = sweep.emission;

  if (is_full || options_.volume_bounces > 0) {
    const bool goes_on = is_full || options_.volume_bounces > 1;
    result[Layer::VolumeDirect] = glow(ray, hit.t, random);
    if (const ScatterPoint& scatter = sweep.scatter; scatter.is_set) {
      const Vec3d p = ray.at(scatter.t);
      result[Layer::VolumeDirect] +=
          scatter.weight *
          direct_in_medium(p, ray.direction, scatter.volume, goes_on, &points, random);
      if (goes_on) {
        const Gathered light =
            gather(scattered_ray(p, ray.direction, scatter.volume, points.square(kPhaseRay)),
                   scatter.weight, 1, random);
        result[Layer::VolumeDirect] += light.direct;
        result[Layer::VolumeIndirect] = light.indirect;
      }
    }
  }

  if (hit.is_hit()) {
    const Surface surface = surface_at(hit, -ray.direction);
    result.alpha = 1;
    result.z = hit.t;
    result.normal = surface.shading_normal;
    result.position = hit.position;
    result.albedo = RgbD(surface.material->albedo) + RgbD(surface.material->specular);
    result[Layer::Emission] = sweep.transmittance * world_.emission(hit, surface.wo);
    if (!is_black(sweep.transmittance) && surface.material->reflects())
      shade_eye(surface, sweep.transmittance, points, random, result);
  } else {
    result.alpha = 1 - mean_component(sweep.transmittance);
    result.z = kInfinity;
    result[Layer::Background] = sweep.transmittance * world_.background(ray.direction);
  }
  result.cost = static_cast<double>(rays() + lookups() - cost_before);
  return result;
}

void ReferencePaths::shade_eye(const Surface& s, const RgbD& transmittance,
                               const SamplePoints& points, RandomStream& random,
                               PixelResult& result) {
  const Material& material = *s.material;
  const bool has_rays = options_.transport == Transport::Full || options_.bounces > 0;
  const Reflected direct = direct_light(
      s.point(), false,
      [&](const Vec3d& wi) {
        const double cosine = s.cosine(wi);
        Lobes lobes;
        if (!(cosine > 0)) return lobes;
        lobes.value[0] = s.diffuse(cosine);
        lobes.value[1] = s.glossy(wi, cosine);
        if (has_rays) {
          lobes.pdf[0] = is_black(lobes.value[0]) ? 0 : cosine * kInvPi;
          lobes.pdf[1] = pdf_specular(material, s.shading_normal, wi, s.wo);
        }
        return lobes;
      },
      &points, random);
  result[Layer::DiffuseDirect] = transmittance * direct.value[0];
  result[Layer::GlossyDirect] = transmittance * direct.value[1];
  if (!has_rays) return;

  const auto follow = [&](const Vec3d& wi, double pdf, const RgbD& weight, Layer direct_layer,
                          Layer indirect_layer) {
    if (!(pdf > 0) || !(s.cosine(wi) > 0)) return;
    const Gathered light =
        gather({{s.point(), wi}, s.point(), pdf}, transmittance * weight, 0, random);
    result[direct_layer] += light.direct;
    result[indirect_layer] += light.indirect;
  };
  if (!is_black(material.albedo)) {
    const Vec3d local = sample_cosine_hemisphere(points.square(kDiffuseRay));
    follow(Frame(s.shading_normal).to_world(local), local.z * kInvPi, RgbD(material.albedo),
           Layer::DiffuseDirect, Layer::DiffuseIndirect);
  }
  if (material.is_glossy()) {
    const BrdfSample sample =
        sample_specular(material, s.shading_normal, s.wo, points.square(kGlossyRay));
    follow(sample.wi, sample.pdf, sample.weight, Layer::GlossyDirect, Layer::GlossyIndirect);
  }
}

RgbD ReferencePaths::indirect_irradiance(const Hit& hit, const Vec3d& normal, const Vec2d& u,
                                         RandomStream& random) {
  if (options_.transport == Transport::Cached && options_.bounces < 1) return {};
  const Vec3d local = sample_cosine_hemisphere(u), wi = Frame(normal).to_world(local);
  const Vec3d above = hit.normal.dot(normal) >= 0 ? hit.normal : -hit.normal;
  if (!(local.z > 0) || !(above.dot(wi) > 0)) return {};
  const Vec3d p = hit.position + above * hit.offset;
  return gather({{p, wi}, p, local.z * kInvPi}, RgbD(kPi), 0, random).indirect;
}

ReferencePaths::DrawnRay ReferencePaths::scattered_ray(const Vec3d& p, const Vec3d& direction,
                                                       int volume, const Vec2d& u) const {
  const PhaseSample sample = world_.medium().volumes()[volume].phase.sample(direction, u);
  return {{p, sample.direction}, p, sample.pdf};
}

ReferencePaths::DrawnRay ReferencePaths::reflected_ray(const Surface& s, RgbD& weight,
                                                       RandomStream& random) const {
  const double u = random.uniform();
  const BrdfSample sample = sample_brdf(*s.material, s.shading_normal, s.wo, u, random.uniform2());
  const bool is_reflection = sample.pdf > 0 && s.cosine(sample.wi) > 0;
  weight = is_reflection ? weight * sample.weight : RgbD();
  return {{s.point(), sample.wi}, s.point(), sample.pdf};
}

ReferencePaths::Gathered ReferencePaths::gather(const DrawnRay& drawn, const RgbD& weight,
                                                int scatterings, RandomStream& random) {
  return options_.transport == Transport::Full
             ? gather_full(drawn, weight, random)
             : gather_cached(drawn, weight, scatterings, random);
}

// E_l of the cached integrator with l = bounces: every segment brings what the medium emits and
// scatters and what "direct": false emitters emit; every surface but the last also reflects direct
// light. Each segment is seen whole, and then one of its two ways on is taken, that through the
// scattering point or that off the surface, in proportion to what each is worth: paths do not
// branch.
ReferencePaths::Gathered ReferencePaths::gather_cached(DrawnRay drawn, RgbD weight,
                                                       int scatterings, RandomStream& random) {
  Gathered light;
  int level = options_.bounces;
  for (int vertex = 1;; ++vertex) {
    const Hit hit = intersect(drawn.ray);
    const Sweep sweep = tracker_.sweep(drawn.ray, hit.t, weight, random);
    light.indirect += sweep.emission;

    const ScatterPoint& scatter = sweep.scatter;
    const bool can_scatter = scatter.is_set && scatterings + 1 < options_.volume_bounces;
    const Vec3d p = drawn.ray.at(scatter.t);
    if (options_.volume_bounces > 0) {
      light.indirect += weight * glow(drawn.ray, hit.t, random);
      if (scatter.is_set)
        light.indirect +=
            scatter.weight * direct_in_medium(p, drawn.ray.direction, scatter.volume, can_scatter,
                                              nullptr, random);
    }

    const RgbD passed = sweep.transmittance;
    Surface surface;
    bool can_reflect = false;
    if (!is_black(passed)) {
      RgbD& emitters = vertex == 1 ? light.direct : light.indirect;
      emitters += passed * (hit.is_hit() ? emitter_hit(hit, drawn) : environment_hit(drawn));
      if (hit.is_hit()) {
        surface = surface_at(hit, -drawn.ray.direction);
        if (!surface.material->direct)
          light.indirect += passed * world_.emission(hit, surface.wo);
        can_reflect = level > 0 && surface.material->reflects();
        if (can_reflect) light.indirect += passed * direct_on_surface(surface, random);
      }
    }

    if (!can_scatter && !can_reflect) break;
    double scatter_share = can_scatter ? 1 : 0;
    if (can_scatter && can_reflect) {
      const double a = mean_component(scatter.weight),
                   b = mean_component(passed * (RgbD(surface.material->albedo) +
                                                RgbD(surface.material->specular)));
      scatter_share = a / (a + b);
    }
    if (scatter_share == 1 || (scatter_share > 0 && random.uniform() < scatter_share)) {
      weight = scatter.weight / scatter_share;
      drawn = scattered_ray(p, drawn.ray.direction, scatter.volume, random.uniform2());
      ++scatterings;
    } else {
      weight = passed / (1 - scatter_share);
      drawn = reflected_ray(surface, weight, random);
      scatterings = 0;
      --level;
    }
    if (is_black(weight)) break;
    // Where no scattering goes on, `bounces` alone ends the path.
    if (options_.volume_bounces > 1 && !play_roulette(vertex, weight, random)) break;
  }
  return light;
}

// Everything, until the dice end it.
ReferencePaths::Gathered ReferencePaths::gather_full(DrawnRay drawn, RgbD weight,
                                                     RandomStream& random) {
  Gathered light;
  for (int vertex = 1;; ++vertex) {
    const Hit hit = intersect(drawn.ray);
    light.indirect += weight * glow(drawn.ray, hit.t, random);
    const Flight flight = tracker_.fly(drawn.ray, hit.t, weight, random);
    light.indirect += flight.emission;
    weight = flight.weight;
    if (is_black(weight)) break;

    if (flight.scatter.is_set) {
      const Vec3d p = drawn.ray.at(flight.scatter.t);
      light.indirect += weight * direct_in_medium(p, drawn.ray.direction, flight.scatter.volume,
                                                  true, nullptr, random);
      drawn = scattered_ray(p, drawn.ray.direction, flight.scatter.volume, random.uniform2());
    } else {
      RgbD& emitters = vertex == 1 ? light.direct : light.indirect;
      if (!hit.is_hit()) {
        emitters += weight * environment_hit(drawn);
        break;
      }
      emitters += weight * emitter_hit(hit, drawn);
      const Surface s = surface_at(hit, -drawn.ray.direction);
      if (!s.material->direct) light.indirect += weight * world_.emission(hit, s.wo);
      if (!s.material->reflects()) break;
      light.indirect += weight * direct_on_surface(s, random);
      drawn = reflected_ray(s, weight, random);
      if (is_black(weight)) break;
    }
    if (!play_roulette(vertex, weight, random)) break;
  }
  return light;
}

}  // namespace brume
