#include "scene/material.h"

#include "core/sampling.h"

namespace brume {
namespace {

// A mirror has no density; below this roughness the lobe is narrower than any pixel.
constexpr double kMinAlpha = 1e-3;

double alpha_of(const Material& material) {
  const double r = material.roughness;
  return std::max(kMinAlpha, r * r);
}

// [WMLT07, Eq. 33] written without tangents; `h` is in the shading frame.
double ggx_d(const Vec3d& h, double alpha) {
  const double e = (h.x * h.x + h.y * h.y) / (alpha * alpha) + h.z * h.z;
  return 1 / (kPi * alpha * alpha * e * e);
}

// Smith's Lambda times two, plus one: sqrt(1 + alpha^2 tan^2).
double ggx_root(double cosine, double alpha) {
  const double tan2 = std::max(0.0, 1 - cosine * cosine) / (cosine * cosine);
  return std::sqrt(1 + alpha * alpha * tan2);
}
double ggx_g1(double cosine, double alpha) { return 2 / (1 + ggx_root(cosine, alpha)); }
// Height-correlated [Heitz14, Eq. 99].
double ggx_g2(double cos_i, double cos_o, double alpha) {
  return 2 / (ggx_root(cos_i, alpha) + ggx_root(cos_o, alpha));
}

// Local directions, both above the surface.
RgbD eval_specular_local(const Material& material, const Vec3d& i, const Vec3d& o) {
  const double alpha = alpha_of(material);
  const Vec3d h = (i + o).normalized();
  return RgbD(material.specular) * (ggx_d(h, alpha) * ggx_g2(i.z, o.z, alpha) / (4 * i.z * o.z));
}

double pdf_specular_local(double alpha, const Vec3d& i, const Vec3d& o) {
  const Vec3d h = (i + o).normalized();
  return ggx_g1(o.z, alpha) * ggx_d(h, alpha) / (4 * o.z);
}

// A visible normal [Heitz18, listing 1].
Vec3d sample_visible_normal(const Vec3d& o, double alpha, const Vec2d& u) {
  const Vec3d v = Vec3d(alpha * o.x, alpha * o.y, o.z).normalized();
  const double length2 = v.x * v.x + v.y * v.y;
  const Vec3d t1 = length2 > 0 ? Vec3d(-v.y, v.x, 0) / std::sqrt(length2) : Vec3d(1, 0, 0);
  const Vec3d t2 = v.cross(t1);
  const double r = std::sqrt(u.x), phi = 2 * kPi * u.y;
  const double p1 = r * std::cos(phi), s = 0.5 * (1 + v.z);
  const double p2 = (1 - s) * std::sqrt(std::max(0.0, 1 - p1 * p1)) + s * r * std::sin(phi);
  const Vec3d n = t1 * p1 + t2 * p2 + v * std::sqrt(std::max(0.0, 1 - p1 * p1 - p2 * p2));
  return Vec3d(alpha * n.x, alpha * n.y, std::max(1e-12, n.z)).normalized();
}

Vec3d sample_specular_local(double alpha, const Vec3d& o, const Vec2d& u) {
  const Vec3d h = sample_visible_normal(o, alpha, u);
  return h * (2 * o.dot(h)) - o;
}

// Share of samples for the glossy lobe.
double specular_share(const Material& material) {
  if (!material.is_glossy()) return 0;
  const double s = mean_component(material.specular), d = mean_component(material.albedo);
  return s / (s + d);
}

double pdf_local(const Material& material, const Vec3d& i, const Vec3d& o) {
  const double share = specular_share(material);
  double pdf = (1 - share) * i.z * kInvPi;
  if (share > 0) pdf += share * pdf_specular_local(alpha_of(material), i, o);
  return pdf;
}

}  // namespace

RgbD eval_specular(const Material& material, const Vec3d& n, const Vec3d& wi, const Vec3d& wo) {
  if (!material.is_glossy()) return {};
  const Frame frame(n);
  const Vec3d i = frame.to_local(wi), o = frame.to_local(wo);
  if (!(i.z > 0 && o.z > 0)) return {};
  return eval_specular_local(material, i, o);
}

RgbD eval_brdf(const Material& material, const Vec3d& n, const Vec3d& wi, const Vec3d& wo) {
  if (!(n.dot(wi) > 0 && n.dot(wo) > 0)) return {};
  return RgbD(material.albedo) * kInvPi + eval_specular(material, n, wi, wo);
}

double pdf_brdf(const Material& material, const Vec3d& n, const Vec3d& wi, const Vec3d& wo) {
  if (!material.reflects()) return 0;
  const Frame frame(n);
  const Vec3d i = frame.to_local(wi), o = frame.to_local(wo);
  return i.z > 0 && o.z > 0 ? pdf_local(material, i, o) : 0;
}

BrdfSample sample_brdf(const Material& material, const Vec3d& n, const Vec3d& wo, double u_lobe,
                       const Vec2d& u) {
  if (!material.reflects()) return {};
  const Frame frame(n);
  const Vec3d o = frame.to_local(wo);
  if (!(o.z > 0)) return {};
  const Vec3d i = u_lobe < specular_share(material)
                      ? sample_specular_local(alpha_of(material), o, u)
                      : sample_cosine_hemisphere(u);
  if (!(i.z > 0)) return {};
  const double pdf = pdf_local(material, i, o);
  if (!(pdf > 0)) return {};
  RgbD f = RgbD(material.albedo) * kInvPi;
  if (material.is_glossy()) f += eval_specular_local(material, i, o);
  return {frame.to_world(i), f * (i.z / pdf), pdf};
}

double pdf_specular(const Material& material, const Vec3d& n, const Vec3d& wi, const Vec3d& wo) {
  if (!material.is_glossy()) return 0;
  const Frame frame(n);
  const Vec3d i = frame.to_local(wi), o = frame.to_local(wo);
  return i.z > 0 && o.z > 0 ? pdf_specular_local(alpha_of(material), i, o) : 0;
}

BrdfSample sample_specular(const Material& material, const Vec3d& n, const Vec3d& wo,
                           const Vec2d& u) {
  if (!material.is_glossy()) return {};
  const Frame frame(n);
  const Vec3d o = frame.to_local(wo);
  if (!(o.z > 0)) return {};
  const double alpha = alpha_of(material);
  const Vec3d i = sample_specular_local(alpha, o, u);
  if (!(i.z > 0)) return {};
  // f cos / pdf with D and the cosines cancelled.
  const RgbD weight = RgbD(material.specular) * (ggx_g2(i.z, o.z, alpha) / ggx_g1(o.z, alpha));
  return {frame.to_world(i), weight, pdf_specular_local(alpha, i, o)};
}

}  // namespace brume
