// Quads and emissive meshes.
#include <optional>

#include "core/sampling.h"
#include "scene/light_types.h"
#include "scene/spherical_rectangle.h"

namespace brume {
namespace {

// Beyond this many times its longest edge, squared, a rectangle looks flat and small: uniform over
// the area is then as good as over the solid angle, and cheaper.
constexpr double kFarTimes2 = 4;
// Below this solid angle its sampling loses digits.
constexpr double kMinSolidAngle = 1e-7;
constexpr double kPerpendicular = 1e-9;

// Radiance times about the solid angle of something that is `area` large, of which no part is much
// nearer than its centre's distance or its own radius.
double brightness_of(double radiance, double area, double distance2) {
  return radiance * area / (distance2 + area / kPi);
}

// The part shared by everything flat or made of flat parts: p sees radiance from a point of it.
struct Emitter {
  RgbD radiance;
  bool two_sided = false;

  // `cosine` between the emitter's normal and the direction towards p.
  bool faces(double cosine) const { return two_sided ? cosine != 0 : cosine > 0; }
  // Of a point chosen uniformly over `area`.
  double area_pdf(double distance, double cosine, double area) const {
    return faces(cosine) ? distance * distance / (area * std::abs(cosine)) : 0;
  }
  // From a point of it; of the side that the normal is on, or of either.
  Ray ray_from(const Vec3d& q, const Vec3d& normal, const Vec2d& way) const {
    const bool is_back = two_sided && way.x >= 0.5;
    const Vec2d u(two_sided ? std::fmod(2 * way.x, 1.0) : way.x, way.y);
    return {q, Frame(is_back ? -normal : normal).to_world(sample_cosine_hemisphere(u))};
  }
  LightSample to_area_point(const Vec3d& p, const Vec3d& q, const Vec3d& normal,
                            double area) const {
    const Vec3d d = q - p;
    const double distance = d.length();
    if (!(distance > 0)) return {};
    const Vec3d direction = d / distance;
    const double density = area_pdf(distance, -normal.dot(direction), area);
    if (!(density > 0) || !std::isfinite(density)) return {direction, distance, {}, 0};
    return {direction, distance, radiance / density, density};
  }
};

// A parallelogram; rectangles are sampled by solid angle from near.
class QuadShape {
 public:
  QuadShape(const Vec3d& corner, const Vec3d& edge_u, const Vec3d& edge_v)
      : corner_(corner), edge_u_(edge_u), edge_v_(edge_v) {
    const Vec3d cross = edge_u.cross(edge_v);
    area_ = cross.length();
    if (!std::isfinite(area_)) area_ = 0;
    if (area_ > 0) normal_ = cross / area_;
    is_rectangle_ =
        std::abs(edge_u.dot(edge_v)) <= kPerpendicular * edge_u.length() * edge_v.length();
    longest2_ = std::max(edge_u.length2(), edge_v.length2());
  }

  double area() const { return area_; }
  Vec3d centre() const { return corner_ + (edge_u_ + edge_v_) * 0.5; }
  Box3d bounds() const {
    Box3d box(corner_);
    box.extendBy(corner_ + edge_u_);
    box.extendBy(corner_ + edge_v_);
    box.extendBy(corner_ + edge_u_ + edge_v_);
    return box;
  }

  LightSample sample(const Emitter& emitter, const Vec3d& p, const Vec2d& u) const {
    if (!(area_ > 0)) return {};
    if (const auto sphere = solid_angle_from(p)) {
      const Vec3d d = sphere->sample(u) - p;
      const double distance = d.length();
      if (!(distance > 0)) return {};
      const Vec3d direction = d / distance;
      if (!emitter.faces(-normal_.dot(direction))) return {direction, distance, {}, 0};
      return {direction, distance, emitter.radiance * sphere->solid_angle(),
              1 / sphere->solid_angle()};
    }
    return emitter.to_area_point(p, corner_ + edge_u_ * u.x + edge_v_ * u.y, normal_, area_);
  }
  void brightness_along(const Emitter& emitter, const Ray& ray, std::span<const double> t,
                        std::span<double> brightness) const {
    const Vec3d from = ray.origin - centre();
    const double radiance = luminance(emitter.radiance), near2 = 0.1 * area_;
    for (std::size_t i = 0; i < t.size(); ++i) {
      const Vec3d d = from + ray.direction * t[i];
      const double height = normal_.dot(d), distance2 = d.length2();
      // From within a few of its widths it is nowhere seen as edge-on as its centre is.
      const double cosine = std::sqrt((height * height + near2) / (distance2 + near2));
      brightness[i] = area_ > 0 && emitter.faces(height)
                          ? cosine * brightness_of(radiance, area_, distance2)
                          : 0;
    }
  }
  double pdf(const Emitter& emitter, const Vec3d& p, const Vec3d& direction,
             double distance) const {
    const double cosine = -normal_.dot(direction);
    if (!(area_ > 0) || !emitter.faces(cosine)) return 0;
    if (const auto sphere = solid_angle_from(p)) return 1 / sphere->solid_angle();
    return emitter.area_pdf(distance, cosine, area_);
  }
  Ray emit(const Emitter& emitter, const Vec2d& place, const Vec2d& way) const {
    return emitter.ray_from(corner_ + edge_u_ * place.x + edge_v_ * place.y, normal_, way);
  }
  void append_to(std::vector<double>& values) const {
    for (const Vec3d& v : {corner_, edge_u_, edge_v_}) values.insert(values.end(), {v.x, v.y, v.z});
  }

 private:
  // Nothing where points are drawn uniformly over the area instead.
  std::optional<SphericalRectangle> solid_angle_from(const Vec3d& p) const {
    if (!is_rectangle_ || (centre() - p).length2() > kFarTimes2 * longest2_) return std::nullopt;
    SphericalRectangle sphere(corner_, edge_u_, edge_v_, p);
    if (!(sphere.solid_angle() > kMinSolidAngle)) return std::nullopt;
    return sphere;
  }

  Vec3d corner_, edge_u_, edge_v_, normal_{0.0};
  double area_ = 0, longest2_ = 0;
  bool is_rectangle_ = false;
};

void append(std::vector<double>& values, const Emitter& e) {
  values.insert(values.end(), {e.radiance.r, e.radiance.g, e.radiance.b, double(e.two_sided)});
}

double emitted_power(const Emitter& e, double area, double unit) {
  return kPi * area * unit * unit * luminance(e.radiance) * (e.two_sided ? 2 : 1);
}

class ReadyQuadLight final : public Light {
 public:
  ReadyQuadLight(Kind kind, const QuadShape& shape, const Emitter& emitter, double unit)
      : kind_(kind), shape_(shape), emitter_(emitter), unit_(unit) {}

  Kind kind() const override { return kind_; }
  LightSample sample(const Vec3d& p, const Vec2d& u) const override {
    return shape_.sample(emitter_, p, u);
  }
  void brightness_along(const Ray& ray, std::span<const double> t,
                        std::span<double> brightness) const override {
    shape_.brightness_along(emitter_, ray, t, brightness);
  }
  double pdf(const Vec3d& p, const Vec3d& direction, double distance, const Vec3d&) const override {
    return shape_.pdf(emitter_, p, direction, distance);
  }
  std::optional<Ray> emit(const Vec2d& place, const Vec2d& way) const override {
    if (!(shape_.area() > 0)) return std::nullopt;
    return shape_.emit(emitter_, place, way);
  }
  double importance() const override { return emitted_power(emitter_, shape_.area(), unit_); }
  Vec3d centre() const override { return shape_.centre(); }
  Box3d bounds() const override { return shape_.bounds(); }
  void add_to(FingerprintBuilder& fingerprint) const override {
    std::vector<double> values;
    shape_.append_to(values);
    append(values, emitter_);
    add_values(fingerprint, kind_, values);
  }

 private:
  Kind kind_;
  QuadShape shape_;
  Emitter emitter_;
  double unit_;
};

class ReadyMeshLight final : public Light {
 public:
  ReadyMeshLight(std::vector<EmitterTriangle> triangles, const Emitter& emitter, double unit)
      : triangles_(std::move(triangles)), emitter_(emitter), unit_(unit) {
    for (const EmitterTriangle& t : triangles_) {
      const double area = 0.5 * (t.b - t.a).cross(t.c - t.a).length();
      if (std::isfinite(area)) area_ += area;
      cumulative_area_.push_back(area_);
      centre_ += (t.a + t.b + t.c) * (area / 3);
      for (const Vec3d& p : {t.a, t.b, t.c}) bounds_.extendBy(p);
    }
    if (area_ > 0) centre_ /= area_;
  }

  Kind kind() const override { return Kind::Mesh; }
  LightSample sample(const Vec3d& p, const Vec2d& u) const override {
    const std::optional<Place> at = place(u);
    return at ? emitter_.to_area_point(p, at->position, at->normal, area_) : LightSample{};
  }
  // Its triangles may face any way and lie anywhere in its box.
  void brightness_along(const Ray& ray, std::span<const double> t,
                        std::span<double> brightness) const override {
    const Vec3d from = ray.origin - centre_;
    const double radius2 = area_ > 0 ? 0.25 * bounds_.size().length2() : 0;
    for (std::size_t i = 0; i < t.size(); ++i)
      brightness[i] = area_ > 0 ? brightness_of(luminance(emitter_.radiance), area_,
                                                (from + ray.direction * t[i]).length2() + radius2)
                                : 0;
  }
  double pdf(const Vec3d&, const Vec3d& direction, double distance,
             const Vec3d& light_normal) const override {
    return area_ > 0 ? emitter_.area_pdf(distance, -light_normal.dot(direction), area_) : 0;
  }
  std::optional<Ray> emit(const Vec2d& u, const Vec2d& way) const override {
    const std::optional<Place> at = place(u);
    if (!at) return std::nullopt;
    return emitter_.ray_from(at->position, at->normal, way);
  }
  double importance() const override { return emitted_power(emitter_, area_, unit_); }
  Vec3d centre() const override { return centre_; }
  Box3d bounds() const override { return bounds_; }
  void add_to(FingerprintBuilder& fingerprint) const override {
    std::vector<double> values;
    for (const EmitterTriangle& t : triangles_)
      for (const Vec3d& p : {t.a, t.b, t.c}) values.insert(values.end(), {p.x, p.y, p.z});
    append(values, emitter_);
    add_values(fingerprint, kind(), values);
  }

 private:
  struct Place {
    Vec3d position{0.0}, normal{0.0};
  };
  // Uniform over the area.
  std::optional<Place> place(const Vec2d& u) const {
    if (!(area_ > 0)) return std::nullopt;
    const double at = u.x * area_;
    const auto found = std::upper_bound(cumulative_area_.begin(), cumulative_area_.end(), at);
    const std::size_t i =
        std::min<std::size_t>(found - cumulative_area_.begin(), triangles_.size() - 1);
    const double first = i ? cumulative_area_[i - 1] : 0, share = cumulative_area_[i] - first;
    if (!(share > 0)) return std::nullopt;
    // What is left of u.x within its triangle is uniform again.
    const double u_x = std::clamp((at - first) / share, 0.0, 1.0), s = std::sqrt(u_x);
    const EmitterTriangle& t = triangles_[i];
    const Vec3d e1 = t.b - t.a, e2 = t.c - t.a;
    return Place{t.a + e1 * (1 - s) + e2 * (u.y * s), e1.cross(e2).normalized()};
  }

  std::vector<EmitterTriangle> triangles_;
  std::vector<double> cumulative_area_;
  Emitter emitter_;
  double area_ = 0, unit_;
  Vec3d centre_{0.0};
  Box3d bounds_;
};

// The parallelogram that two triangles make when they share an edge and face the same way.
std::optional<QuadShape> as_rectangle(const std::vector<EmitterTriangle>& triangles) {
  if (triangles.size() != 2) return std::nullopt;
  const Vec3d first[3] = {triangles[0].a, triangles[0].b, triangles[0].c};
  const Vec3d second[3] = {triangles[1].a, triangles[1].b, triangles[1].c};
  for (int i = 0; i < 3; ++i) {
    const Vec3d &corner = first[i], &next = first[(i + 1) % 3], &previous = first[(i + 2) % 3];
    const Vec3d edge_u = next - corner, edge_v = previous - corner;
    const double length = edge_u.length() * edge_v.length();
    if (std::abs(edge_u.dot(edge_v)) > kPerpendicular * length) continue;
    // The other triangle runs next -> opposite -> previous.
    const Vec3d opposite = next + edge_v;
    const double close2 = 1e-18 * (edge_u.length2() + edge_v.length2());
    const auto same = [&](const Vec3d& a, const Vec3d& b) { return (a - b).length2() <= close2; };
    for (int k = 0; k < 3; ++k)
      if (same(second[k], next) && same(second[(k + 1) % 3], opposite) &&
          same(second[(k + 2) % 3], previous))
        return QuadShape(corner, edge_u, edge_v);
  }
  return std::nullopt;
}

}  // namespace

std::unique_ptr<Light> make_quad_light(const QuadLight& d, double unit) {
  return std::make_unique<ReadyQuadLight>(Light::Kind::Quad,
                                          QuadShape(d.corner, d.edge_u, d.edge_v),
                                          Emitter{RgbD(d.radiance), false}, unit);
}

std::unique_ptr<Light> make_mesh_light(std::vector<EmitterTriangle> triangles, const Rgb& radiance,
                                       bool two_sided, double unit) {
  const Emitter emitter{RgbD(radiance), two_sided};
  if (const auto rectangle = as_rectangle(triangles))
    return std::make_unique<ReadyQuadLight>(Light::Kind::Mesh, *rectangle, emitter, unit);
  return std::make_unique<ReadyMeshLight>(std::move(triangles), emitter, unit);
}

}  // namespace brume
