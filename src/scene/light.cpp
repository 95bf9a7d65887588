// Lights of no size, and the choice between kinds.
#include "scene/light.h"

#include "core/sampling.h"
#include "scene/light_types.h"

namespace brume {
namespace {

struct ToPoint {
  Vec3d direction{0.0};
  double distance = 0;  // Scene units.
  bool is_defined() const { return distance > 0; }
};

ToPoint towards(const Vec3d& from, const Vec3d& to) {
  const Vec3d d = to - from;
  const double distance = d.length();
  if (!(distance > 0)) return {};
  return {d / distance, distance};
}

// Intensity over the square of the distance, which is that from the ray's nearest point and along
// it.
void brightness_of_point(double intensity, const Vec3d& position, const Ray& ray,
                         std::span<const double> t, std::span<double> brightness) {
  const double t0 = (position - ray.origin).dot(ray.direction);
  const double height2 = (position - ray.at(t0)).length2();
  for (std::size_t i = 0; i < t.size(); ++i) {
    const double d2 = height2 + (t[i] - t0) * (t[i] - t0);
    brightness[i] = d2 > 0 ? intensity / d2 : 0;
  }
}

class ReadyPointLight final : public Light {
 public:
  ReadyPointLight(const PointLight& d, double unit)
      : position_(d.position), intensity_(d.intensity), unit_(unit) {}

  Kind kind() const override { return Kind::Point; }
  LightSample sample(const Vec3d& p, const Vec2d&) const override {
    const ToPoint to = towards(p, position_);
    if (!to.is_defined()) return {};
    const double metres = to.distance * unit_;
    return {to.direction, to.distance, intensity_ / (metres * metres), 0};
  }
  void brightness_along(const Ray& ray, std::span<const double> t,
                        std::span<double> brightness) const override {
    brightness_of_point(luminance(intensity_) / (unit_ * unit_), position_, ray, t, brightness);
  }
  double pdf(const Vec3d&, const Vec3d&, double, const Vec3d&) const override { return 0; }
  std::optional<Ray> emit(const Vec2d&, const Vec2d& way) const override {
    return Ray{position_, sample_sphere(way)};
  }
  double importance() const override { return 4 * kPi * luminance(intensity_); }
  Vec3d centre() const override { return position_; }
  Box3d bounds() const override { return Box3d(position_); }
  void add_to(FingerprintBuilder& fingerprint) const override {
    const double v[] = {position_.x,  position_.y,  position_.z, intensity_.r,
                        intensity_.g, intensity_.b, unit_};
    add_values(fingerprint, kind(), v);
  }

 private:
  Vec3d position_;
  RgbD intensity_;
  double unit_;
};

class ReadySpotLight final : public Light {
 public:
  ReadySpotLight(const SpotLight& d, double unit)
      : position_(d.position),
        direction_(d.direction.normalized()),
        intensity_(d.intensity),
        cos_inner_(std::cos(d.inner_deg * kPi / 180)),
        cos_outer_(std::cos(d.outer_deg * kPi / 180)),
        unit_(unit) {}

  Kind kind() const override { return Kind::Spot; }
  LightSample sample(const Vec3d& p, const Vec2d&) const override {
    const ToPoint to = towards(p, position_);
    if (!to.is_defined()) return {};
    const double metres = to.distance * unit_;
    const double falloff = smoothstep(-direction_.dot(to.direction));
    return {to.direction, to.distance, intensity_ * (falloff / (metres * metres)), 0};
  }
  void brightness_along(const Ray& ray, std::span<const double> t,
                        std::span<double> brightness) const override {
    brightness_of_point(luminance(intensity_) / (unit_ * unit_), position_, ray, t, brightness);
  }
  Interval lit_stretch(const Ray& ray) const override;
  LightCone cone() const override { return {direction_, cos_outer_}; }
  double pdf(const Vec3d&, const Vec3d&, double, const Vec3d&) const override { return 0; }
  std::optional<Ray> emit(const Vec2d&, const Vec2d& way) const override {
    const double z = 1 - way.x * (1 - cos_outer_), s = std::sqrt(std::max(0.0, 1 - z * z));
    const double phi = 2 * kPi * way.y;
    return Ray{position_, Frame(direction_).to_world({s * std::cos(phi), s * std::sin(phi), z})};
  }
  double importance() const override {
    return 2 * kPi * (1 - 0.5 * (cos_inner_ + cos_outer_)) * luminance(intensity_);
  }
  Vec3d centre() const override { return position_; }
  Box3d bounds() const override { return Box3d(position_); }
  void add_to(FingerprintBuilder& fingerprint) const override {
    const double v[] = {position_.x,  position_.y,  position_.z,  direction_.x,
                        direction_.y, direction_.z, intensity_.r, intensity_.g,
                        intensity_.b, cos_inner_,   cos_outer_,   unit_};
    add_values(fingerprint, kind(), v);
  }

 private:
  double smoothstep(double cosine) const {
    if (cosine >= cos_inner_) return 1;
    if (cosine <= cos_outer_) return 0;
    const double x = (cosine - cos_outer_) / (cos_inner_ - cos_outer_);
    return x * x * (3 - 2 * x);
  }

  Vec3d position_, direction_;
  RgbD intensity_;
  double cos_inner_, cos_outer_, unit_;
};

// Within the cone, which is convex: where (v.d)^2 >= cos^2 v.v on the side that it opens to, of v
// from the apex, a quadratic in t.
Interval ReadySpotLight::lit_stretch(const Ray& ray) const {
  const double c2 = cos_outer_ * cos_outer_;
  const Vec3d v = ray.origin - position_;
  const double along0 = v.dot(direction_), along1 = ray.direction.dot(direction_);
  const double a2 = along1 * along1 - c2;
  if (!(cos_outer_ > 0) || std::abs(a2) < 1e-9) return {0, kInfinity};
  const double a1 = along0 * along1 - c2 * v.dot(ray.direction);
  const double a0 = along0 * along0 - c2 * v.dot(v);
  const double discriminant = a1 * a1 - a2 * a0;
  if (a2 < 0 && !(discriminant > 0)) return {0, 0};
  const double root = std::sqrt(std::max(0.0, discriminant));
  const double low = (-a1 - std::copysign(root, a2)) / a2,
               high = (-a1 + std::copysign(root, a2)) / a2;
  if (a2 > 0) return along1 > 0 ? Interval{std::max(0.0, high), kInfinity} : Interval{0, low};
  if (!(along0 + along1 * 0.5 * (low + high) > 0)) return {0, 0};
  return {std::max(0.0, low), high};
}

class ReadyDirectionalLight final : public Light {
 public:
  explicit ReadyDirectionalLight(const DirectionalLight& d)
      : direction_(d.direction.normalized()), irradiance_(d.irradiance) {}

  Kind kind() const override { return Kind::Directional; }
  LightSample sample(const Vec3d&, const Vec2d&) const override {
    return {-direction_, kInfinity, irradiance_, 0};
  }
  double pdf(const Vec3d&, const Vec3d&, double, const Vec3d&) const override { return 0; }
  void brightness_along(const Ray&, std::span<const double>,
                        std::span<double> brightness) const override {
    std::fill(brightness.begin(), brightness.end(), luminance(irradiance_));
  }
  double importance() const override { return luminance(irradiance_); }
  Vec3d centre() const override { return direction_; }
  Box3d bounds() const override { return {}; }
  void add_to(FingerprintBuilder& fingerprint) const override {
    const double v[] = {direction_.x,  direction_.y,  direction_.z,
                        irradiance_.r, irradiance_.g, irradiance_.b};
    add_values(fingerprint, kind(), v);
  }

 private:
  Vec3d direction_;
  RgbD irradiance_;
};

template <typename... F>
struct Overloaded : F... {
  using F::operator()...;
};

}  // namespace

RgbD Light::radiance(const Vec3d&) const { return {}; }
std::optional<Ray> Light::emit(const Vec2d&, const Vec2d&) const { return std::nullopt; }
Interval Light::lit_stretch(const Ray&) const { return {0, kInfinity}; }

void add_values(FingerprintBuilder& fingerprint, Light::Kind kind, std::span<const double> values) {
  fingerprint.add(kind).add_bytes(values.data(), values.size_bytes());
}

std::unique_ptr<Light> make_light(const LightDescription& description, double unit,
                                  const Vec3d& up) {
  using Made = std::unique_ptr<Light>;
  return std::visit(
      Overloaded{
          [&](const PointLight& d) -> Made { return std::make_unique<ReadyPointLight>(d, unit); },
          [&](const SpotLight& d) -> Made { return std::make_unique<ReadySpotLight>(d, unit); },
          [&](const DirectionalLight& d) -> Made {
            return std::make_unique<ReadyDirectionalLight>(d);
          },
          [&](const QuadLight& d) -> Made { return make_quad_light(d, unit); },
          [&](const EnvironmentLight& d) -> Made { return make_environment_light(d, up); }},
      description);
}

}  // namespace brume
