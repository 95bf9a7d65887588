// Light from infinitely far, the same from everywhere.
//
// Images are latitude-longitude: the top row looks along the scene's up axis. With up = Y the
// middle column looks along -Z and its right neighbour towards +X; with up = Z it looks along +Y.
#include "core/image.h"
#include "core/sampling.h"
#include "scene/light_types.h"

namespace brume {
namespace {

class ConstantEnvironment final : public Light {
 public:
  explicit ConstantEnvironment(const RgbD& radiance) : radiance_(radiance) {}

  Kind kind() const override { return Kind::Environment; }
  LightSample sample(const Vec3d&, const Vec2d& u) const override {
    return {sample_sphere(u), kInfinity, radiance_ * (4 * kPi), kInvPi / 4};
  }
  double pdf(const Vec3d&, const Vec3d&, double, const Vec3d&) const override { return kInvPi / 4; }
  RgbD radiance(const Vec3d&) const override { return radiance_; }
  void brightness_along(const Ray&, std::span<const double>,
                        std::span<double> brightness) const override {
    std::fill(brightness.begin(), brightness.end(), 4 * kPi * luminance(radiance_));
  }
  double importance() const override { return kPi * luminance(radiance_); }
  Vec3d centre() const override { return Vec3d(0.0); }
  Box3d bounds() const override { return {}; }
  void add_to(FingerprintBuilder& fingerprint) const override {
    const double v[] = {radiance_.r, radiance_.g, radiance_.b};
    add_values(fingerprint, kind(), v);
  }

 private:
  RgbD radiance_;
};

float usable(float x, double scale) {
  const double v = double(x) * scale;
  return v > 0 && std::isfinite(v) ? static_cast<float>(v) : 0.0f;
}

class ImageEnvironment final : public Light {
 public:
  ImageEnvironment(int width, int height, std::vector<Rgb> pixels, double rotation_deg,
                   const Vec3d& up)
      : width_(width), height_(height), pixels_(std::move(pixels)) {
    up_ = up.normalized();
    const Vec3d reference = std::abs(up_.x) < 0.9 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0);
    const Vec3d right = (reference - up_ * reference.dot(up_)).normalized();
    const Vec3d forward = up_.cross(right);
    // The image turns with the right hand about `up`.
    const double a = rotation_deg * kPi / 180;
    right_ = right * std::cos(a) + up_.cross(right) * std::sin(a);
    forward_ = forward * std::cos(a) + up_.cross(forward) * std::sin(a);
    build_table();
  }

  Kind kind() const override { return Kind::Environment; }

  LightSample sample(const Vec3d&, const Vec2d& u) const override {
    if (!(row_cdf_.back() > 0)) return {};
    double v = u.y, h = u.x;
    const int y = pick(row_cdf_.data(), height_, v);
    const int x = pick(&cell_cdf_[std::size_t(y) * width_], width_, h);
    // Uniform over the cell's solid angle.
    const double c0 = std::cos(kPi * y / height_), c1 = std::cos(kPi * (y + 1) / height_);
    const double cosine = c0 + v * (c1 - c0);
    const Vec3d direction = direction_at((x + h) / width_, cosine);
    const double density = cell_pdf(x, y);
    if (!(density > 0)) return {};
    return {direction, kInfinity, radiance(direction) / density, density};
  }
  double pdf(const Vec3d&, const Vec3d& direction, double, const Vec3d&) const override {
    if (!(row_cdf_.back() > 0)) return 0;
    const Vec2d uv = uv_of(direction);
    return cell_pdf(std::min(int(uv.x * width_), width_ - 1),
                    std::min(int(uv.y * height_), height_ - 1));
  }
  // Bilinear between pixel centres.
  RgbD radiance(const Vec3d& direction) const override {
    const Vec2d uv = uv_of(direction);
    const double x = uv.x * width_ - 0.5, y = uv.y * height_ - 0.5;
    const int x0 = int(std::floor(x)), y0 = int(std::floor(y));
    const double fx = x - x0, fy = y - y0;
    return (RgbD(pixel(x0, y0)) * (1 - fx) + RgbD(pixel(x0 + 1, y0)) * fx) * (1 - fy) +
           (RgbD(pixel(x0, y0 + 1)) * (1 - fx) + RgbD(pixel(x0 + 1, y0 + 1)) * fx) * fy;
  }
  void brightness_along(const Ray&, std::span<const double>,
                        std::span<double> brightness) const override {
    std::fill(brightness.begin(), brightness.end(), row_cdf_.back());
  }
  double importance() const override { return row_cdf_.back() / 4; }
  Vec3d centre() const override { return Vec3d(0.0); }
  Box3d bounds() const override { return {}; }
  void add_to(FingerprintBuilder& fingerprint) const override {
    const double v[] = {double(width_), double(height_), right_.x, right_.y,
                        right_.z,       up_.x,           up_.y,    up_.z};
    add_values(fingerprint, kind(), v);
    fingerprint.add_bytes(pixels_.data(), pixels_.size() * sizeof(Rgb));
  }

 private:
  const Rgb& pixel(int x, int y) const {
    x = (x + width_) % width_;
    y = std::clamp(y, 0, height_ - 1);
    return pixels_[std::size_t(y) * width_ + x];
  }
  Vec2d uv_of(const Vec3d& d) const {
    const double u = 0.5 + std::atan2(d.dot(right_), d.dot(forward_)) / (2 * kPi);
    return {std::clamp(u, 0.0, 1.0), std::acos(std::clamp(d.dot(up_), -1.0, 1.0)) / kPi};
  }
  Vec3d direction_at(double u, double cosine) const {
    const double phi = (u - 0.5) * 2 * kPi, s = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    return right_ * (s * std::sin(phi)) + forward_ * (s * std::cos(phi)) + up_ * cosine;
  }
  double cell_solid_angle(int y) const {
    return (std::cos(kPi * y / height_) - std::cos(kPi * (y + 1) / height_)) * 2 * kPi / width_;
  }

  // A cell's weight takes in its neighbours, because the bilinear lookup inside it does: a black
  // pixel beside the sun must not have density 0.
  void build_table() {
    cell_cdf_.resize(std::size_t(width_) * height_);
    row_cdf_.resize(height_);
    double rows = 0;
    for (int y = 0; y < height_; ++y) {
      double cells = 0;
      for (int x = 0; x < width_; ++x) {
        double sum = 0;
        for (int j = -1; j <= 1; ++j)
          for (int i = -1; i <= 1; ++i) sum += mean_component(pixel(x + i, y + j));
        cells += sum / 9 * cell_solid_angle(y);
        cell_cdf_[std::size_t(y) * width_ + x] = cells;
      }
      rows += cells;
      row_cdf_[y] = rows;
    }
  }
  // The entry of an unnormalised CDF that holds `u`, which becomes the place within the entry.
  static int pick(const double* cdf, int count, double& u) {
    const double at = u * cdf[count - 1];
    const int i =
        int(std::min<std::ptrdiff_t>(std::upper_bound(cdf, cdf + count, at) - cdf, count - 1));
    const double first = i ? cdf[i - 1] : 0, share = cdf[i] - first;
    u = share > 0 ? std::clamp((at - first) / share, 0.0, 1.0) : 0.5;
    return i;
  }
  double cell_pdf(int x, int y) const {
    const double* row = &cell_cdf_[std::size_t(y) * width_];
    return (row[x] - (x ? row[x - 1] : 0)) / (row_cdf_.back() * cell_solid_angle(y));
  }

  int width_, height_;
  std::vector<Rgb> pixels_;
  Vec3d right_, forward_, up_;
  std::vector<double> cell_cdf_, row_cdf_;  // Unnormalised; cells along their own row.
};

}  // namespace

std::unique_ptr<Light> make_environment_light(const EnvironmentLight& d, const Vec3d& up) {
  if (d.file.empty()) return std::make_unique<ConstantEnvironment>(RgbD(d.radiance) * d.scale);
  const Image image = read_image(d.file).image;
  std::vector<Rgb> pixels = image.layer("", d.file.string());
  for (Rgb& p : pixels) p = {usable(p.r, d.scale), usable(p.g, d.scale), usable(p.b, d.scale)};
  return std::make_unique<ImageEnvironment>(image.width, image.height, std::move(pixels),
                                            d.rotation_deg, up);
}

}  // namespace brume
