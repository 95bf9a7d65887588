// How surfaces reflect and glow. Directions point away from the surface; cosines with the shading
// normal on the viewer's side.
#pragma once

#include <optional>
#include <string>

#include "core/math.h"

namespace brume {

// Emission that depends on the direction wo it leaves in: radiance * max(0, wo . axis)^exponent. Scene files
// have no key for it; programs that use the libraries may.
struct EmissionLobe {
  Vec3d axis{0.0, 0.0, 1.0};  // Unit.
  double exponent = 1;        // At least 1.
  Rgb radiance{0.0f};
};

// f = albedo/pi + specular * D G / (4 cos_i cos_o), D and G the GGX distribution with
// alpha = roughness^2 and Smith's height-correlated shadowing [WMLT07, Heitz14]. A diffuse material has
// specular 0.
struct Material {
  std::string name;
  Rgb albedo{0.5f}, specular{0.0f};
  float roughness = 1;
  Rgb emission{0.0f};
  // An emitter that is sampled as a light (and not seen by gathers); false: only gathers see it.
  bool direct = true;
  bool two_sided = false;  // Emission on both sides, not only where counter-clockwise winding faces.

  // Adds to `emission`, on the sides that emit. Only for emitters that gathers see ("direct": false).
  std::optional<EmissionLobe> emission_lobe{};

  bool is_emissive() const { return !is_black(emission) || emission_lobe.has_value(); }
  bool is_glossy() const { return !is_black(specular); }
  bool reflects() const { return !is_black(albedo) || is_glossy(); }
};

// Without the cosine [1/sr]; 0 below the surface.
RgbD eval_brdf(const Material& material, const Vec3d& n, const Vec3d& wi, const Vec3d& wo);
// The glossy lobe alone.
RgbD eval_specular(const Material& material, const Vec3d& n, const Vec3d& wi, const Vec3d& wo);

struct BrdfSample {
  Vec3d wi{0.0};
  RgbD weight;     // f cos / pdf.
  double pdf = 0;  // [1/sr]; 0: no sample.
};
// Diffuse and glossy lobes chosen by their reflectance.
BrdfSample sample_brdf(const Material& material, const Vec3d& n, const Vec3d& wo, double u_lobe,
                       const Vec2d& u);
double pdf_brdf(const Material& material, const Vec3d& n, const Vec3d& wi, const Vec3d& wo);
// The glossy lobe alone, by visible normals [Heitz18].
BrdfSample sample_specular(const Material& material, const Vec3d& n, const Vec3d& wo, const Vec2d& u);
double pdf_specular(const Material& material, const Vec3d& n, const Vec3d& wi, const Vec3d& wo);

}  // namespace brume
