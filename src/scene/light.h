// Lights: what a scene file describes, and how points sample them. Visibility and the medium's
// transmittance are the caller's.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "core/hash.h"
#include "core/math.h"
#include "scene/material.h"

namespace brume {

struct PointLight {
  Vec3d position{0.0};
  Rgb intensity;  // [W/sr]
};
struct SpotLight {
  Vec3d position{0.0}, direction{0.0, -1.0, 0.0};
  Rgb intensity;                          // [W/sr] inside inner_deg.
  double inner_deg = 30, outer_deg = 40;  // Half angles; smoothstep of the angle's cosine between.
};
struct DirectionalLight {
  Vec3d direction{0.0, -1.0, 0.0};  // The way the light travels.
  Rgb irradiance;                   // [W/m^2] on a facing surface.
};
struct QuadLight {
  Vec3d corner{0.0}, edge_u{1.0, 0.0, 0.0}, edge_v{0.0, 0.0, 1.0};
  Rgb radiance;  // [W/(m^2 sr)], on the side of edge_u x edge_v; the quad itself is black.
};
struct EnvironmentLight {
  std::filesystem::path file;  // Empty: constant radiance.
  Rgb radiance{1.0f};
  double scale = 1, rotation_deg = 0;  // Rotation about the scene's up axis.
};
using LightDescription =
    std::variant<PointLight, SpotLight, DirectionalLight, QuadLight, EnvironmentLight>;

// Directions within an angle of an axis, which are all where there is no axis.
struct LightCone {
  Vec3d axis{0.0};
  double cosine = -1;
};

struct LightSample {
  Vec3d direction{0.0};  // From the point to the light, unit.
  double distance = kInfinity;
  // Incident radiance over pdf, so that an integral of L f over directions is estimated by
  // weight * f: for point-like lights I/d^2 (distances in metres), for directional ones the
  // irradiance.
  RgbD weight;
  double pdf = 0;  // Per solid angle; 0 for point-like lights, whose samples no BRDF can hit.
};

// A light made ready for sampling. Immutable, thread-safe.
class Light {
 public:
  enum class Kind { Point, Spot, Directional, Quad, Mesh, Environment };
  virtual ~Light() = default;

  virtual Kind kind() const = 0;
  bool is_delta() const { return kind() <= Kind::Directional; }
  // From `p`. Weight 0: nothing arrives (outside the cone, behind the quad).
  virtual LightSample sample(const Vec3d& p, const Vec2d& u) const = 0;
  // The stretch of a ray outside which sample() gives nothing.
  virtual Interval lit_stretch(const Ray& ray) const;
  // About the luminance of what sample() would bring to each `t` along a ray, were nothing in its way:
  // for choosing between places and lights without drawing a sample of each. 0 only where sample()
  // gives nothing; within lit_stretch().
  virtual void brightness_along(const Ray& ray, std::span<const double> t,
                                std::span<double> brightness) const = 0;
  // Where one that is at a point sends its light.
  virtual LightCone cone() const { return {}; }
  // Of sample() giving `direction`, per solid angle; 0 for delta lights. `distance` is to the point
  // hit on the light, `light_normal` its geometric normal (unused by the environment).
  virtual double pdf(const Vec3d& p, const Vec3d& direction, double distance,
                     const Vec3d& light_normal) const = 0;
  // Radiance from infinity along `direction` (pointing away from the viewer); 0 but for
  // environments.
  virtual RgbD radiance(const Vec3d& direction) const;
  // A ray that it sends out, drawn by power (but for what dims a cone's edge); nothing for lights
  // at infinity.
  virtual std::optional<Ray> emit(const Vec2d& place, const Vec2d& way) const;
  // Power-like weight for choosing between lights [W], those at infinity as if the scene were 1 m^2
  // across; scale-free comparisons only.
  virtual double importance() const = 0;
  // A point at the light's centre, for tables of optical depth; direction of travel for directional
  // ones.
  virtual Vec3d centre() const = 0;
  // Where point-like and area lights may touch: the box of the emitter, empty for infinite ones.
  virtual Box3d bounds() const = 0;
  // What the light's answers depend on, images by their pixels.
  virtual void add_to(FingerprintBuilder& fingerprint) const = 0;
};

// Which light a triangle belongs to, so that a BRDF sample that hits it can be weighted.
struct EmitterTriangle {
  Vec3d a{0.0}, b{0.0}, c{0.0};
};

// `unit` is metres per scene unit, `up` the scene's up axis. Reads an environment's image.
std::unique_ptr<Light> make_light(const LightDescription& description, double unit,
                                  const Vec3d& up);
// All triangles of one emissive material; uniform over their area, or over the solid angle where
// they are two that make a rectangle.
std::unique_ptr<Light> make_mesh_light(std::vector<EmitterTriangle> triangles, const Rgb& radiance,
                                       bool two_sided, double unit);

}  // namespace brume
