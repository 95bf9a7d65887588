#include "gather/surface_light.h"

#include "core/lattice.h"

namespace brume {
namespace {

// Directions of neighbouring cells are neighbours in the same lattice, points on lights should not
// be.
constexpr double kStride = 7;

// d/dw of the glossy lobe for wo = -w, by central differences: the lobe is smooth on this scale
// down to the roughness that records take.
RgbGradient lobe_derivative(const Material& material, const Vec3d& n, const Vec3d& wi,
                            const Vec3d& w) {
  constexpr double kStep = 1e-4;
  const Frame frame(w);
  RgbGradient g;
  for (const Vec3d& e : {frame.u, frame.v}) {
    const RgbD ahead = eval_specular(material, n, wi, -(w + e * kStep).normalized());
    const RgbD behind = eval_specular(material, n, wi, -(w - e * kStep).normalized());
    g += outer((ahead - behind) / (2 * kStep), e);
  }
  return g;
}

}  // namespace

void SurfaceLight::begin(std::size_t cells, RandomStream random) {
  lamp_shift_.clear();
  for (std::size_t l = 0; l < lighting_.world().lights().size(); ++l)
    lamp_shift_.push_back(random.uniform2());
  emitted_.assign(cells, RgbD());
  reflected_.assign(cells, RgbD());
  derivative_.assign(cells, RgbGradient());
  pending_.clear();
  has_derivatives_ = false;
}

void SurfaceLight::add(std::size_t cell, const Hit& hit, const Vec3d& w, double footprint,
                       const HitLight& light, Counters& counters) {
  const World& world = lighting_.world();
  const Material& material = world.material(hit);
  if (!material.direct) {
    emitted_[cell] += world.emission(hit, -w);
    if (want_derivatives_ && material.emission_lobe) {
      derivative_[cell] -= world.emission_derivative(hit, -w);  // wo = -w.
      has_derivatives_ = true;
    }
  }
  if (!light.reflect || !material.reflects()) return;
  const bool from_front = hit.normal.dot(w) < 0;
  const Vec3d n = reflecting_normal(hit, w);
  const Vec3d ng = from_front ? hit.normal : -hit.normal;
  const Vec3d p = hit.position + ng * hit.offset;

  for (std::size_t l = 0; l < world.lights().size(); ++l) {
    const LightSample s =
        world.lights()[l]->sample(p, lattice_point(kStride * double(cell), lamp_shift_[l]));
    const double cosine = n.dot(s.direction);
    if (is_black(s.weight) || cosine <= 0 || ng.dot(s.direction) <= 0) continue;
    const RgbD incident = s.weight * cosine;
    Pending pending{
        cell, static_cast<int>(l), s, p, eval_brdf(material, n, s.direction, -w) * incident, {}};
    if (want_derivatives_ && material.is_glossy()) {
      const RgbGradient d = lobe_derivative(material, n, s.direction, w);
      for (int c = 0; c < 3; ++c) pending.derivative[c] = d[c] * incident[c];
      has_derivatives_ = true;
    }
    pending_.push_back(pending);
  }
  if (light.cache == nullptr) return;
  const InterpolatedIrradiance e =
      light.cache->irradiance(hit_query(world, light.layer, hit.position, n, footprint));
  ++counters.cache_queries;
  counters.cache_clamps += e.clamped;
  counters.cache_misses += e.records == 0;
  reflected_[cell] += e.irradiance * diffuse_reflectance(material) * kInvPi;
}

void SurfaceLight::finish(Counters& counters) {
  shadow_rays_.clear();
  for (const Pending& p : pending_) shadow_rays_.push_back(shadow_ray(p.origin, p.sample));
  occluded_.resize(pending_.size());
  lighting_.world().tracer().is_occluded(shadow_rays_, occluded_);
  counters.shadow_rays += pending_.size();
  requests_.clear();
  for (std::size_t i = 0; i < pending_.size(); ++i)
    if (!occluded_[i])
      requests_.push_back({pending_[i].light, pending_[i].sample, pending_[i].origin});
  transmittances_.resize(requests_.size());
  lighting_.transmittances(requests_, transmittances_, counters);
  for (std::size_t i = 0, lit = 0; i < pending_.size(); ++i) {
    if (occluded_[i]) continue;
    const Pending& p = pending_[i];
    const RgbD t = transmittances_[lit++];
    reflected_[p.cell] += p.reflected * t;
    if (has_derivatives_)
      for (int c = 0; c < 3; ++c) derivative_[p.cell][c] += p.derivative[c] * t[c];
  }
}

}  // namespace brume
