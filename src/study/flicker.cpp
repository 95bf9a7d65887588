#include "study/flicker.h"

#include <optional>

#include "core/error.h"

namespace brume {
namespace {

constexpr double kMinNormalCosine = 0.95, kPixelsApart = 2;

Vec3d world(const Vec3f& v) { return {v.x, v.y, v.z}; }

// Where and how frame b sees points.
class Projection {
 public:
  explicit Projection(const FlickerFrame& frame)
      : frame_(frame), half_height_(std::tan(frame.fov_deg * kPi / 360)) {}

  double pixel_width(double depth) const { return 2 * half_height_ * depth / frame_.height; }

  // Image coordinates, pixel centres at halves; nothing behind the camera or beyond the image's
  // edge.
  std::optional<Vec2d> image_of(const Vec3d& p) const {
    const auto& m = frame_.world_to_camera;
    double local[3];
    for (std::size_t i = 0; i < 3; ++i)
      local[i] = m[4 * i] * p.x + m[4 * i + 1] * p.y + m[4 * i + 2] * p.z + m[4 * i + 3];
    if (!(local[2] < 0)) return std::nullopt;
    const double scale = 1 / (-local[2] * half_height_);
    const double x = (local[0] * scale * frame_.height / frame_.width + 1) / 2 * frame_.width;
    const double y = (1 - local[1] * scale) / 2 * frame_.height;
    if (!(x >= 0.5 && x <= frame_.width - 0.5 && y >= 0.5 && y <= frame_.height - 0.5))
      return std::nullopt;
    return Vec2d(x, y);
  }

 private:
  const FlickerFrame& frame_;
  double half_height_;
};

// Four pixels around a place, with bilinear weights.
struct Footprint {
  std::array<std::size_t, 4> pixel;
  std::array<double, 4> weight;

  Footprint(const FlickerFrame& frame, const Vec2d& at) {
    const double x = at.x - 0.5, y = at.y - 0.5;
    const int x0 = std::min(static_cast<int>(x), frame.width - 2);
    const int y0 = std::min(static_cast<int>(y), frame.height - 2);
    const double fx = x - x0, fy = y - y0;
    for (int i = 0; i < 4; ++i) {
      const auto k = static_cast<std::size_t>(i);
      pixel[k] = static_cast<std::size_t>(y0 + i / 2) * frame.width + x0 + i % 2;
      weight[k] = (i % 2 ? fx : 1 - fx) * (i / 2 ? fy : 1 - fy);
    }
  }
  double light(const FlickerFrame& frame) const {
    double sum = 0;
    for (std::size_t k = 0; k < 4; ++k) sum += weight[k] * luminance(RgbD(frame.light[pixel[k]]));
    return sum;
  }
};

bool is_same_surface(const FlickerFrame& a, std::size_t i, const FlickerFrame& b,
                     const Footprint& found, const Projection& projection) {
  Vec3d position(0.0);
  for (std::size_t k = 0; k < 4; ++k) {
    const std::size_t j = found.pixel[k];
    if (!(b.alpha[j] > 0.999f) || !(a.normal[i].dot(b.normal[j]) > kMinNormalCosine)) return false;
    position += world(b.position[j]) * found.weight[k];
  }
  const double apart = (position - world(a.position[i])).length();
  return apart < kPixelsApart * projection.pixel_width(b.depth[found.pixel[0]]);
}

// Sums over the points of a block; one entry a reference in the arrays, the first again where there
// is one.
struct Block {
  int points = 0;
  double change = 0;
  std::array<double, 2> reference_change{};
};

void check_sizes(const FlickerFrame& a, const FlickerFrame& other) {
  if (other.width != a.width || other.height != a.height)
    throw Error(ErrorKind::InvalidInput,
                "frames of " + std::to_string(a.width) + "x" + std::to_string(a.height) + " and " +
                    std::to_string(other.width) + "x" + std::to_string(other.height) +
                    " pixels: only frames of one size can be compared");
}

}  // namespace

double signed_root(double square) { return std::copysign(std::sqrt(std::abs(square)), square); }

Flicker frame_flicker(const FlickerView& from, const FlickerView& to,
                      const FlickerOptions& options) {
  const FlickerFrame &a = from.frame, &b = to.frame;
  check_sizes(a, b);
  for (const FlickerView* view : {&from, &to})
    for (const FlickerFrame& reference : view->references) check_sizes(a, reference);
  if (a.width < 2 || a.height < 2)
    throw Error(ErrorKind::InvalidInput, "frames of less than 2x2 pixels show no flicker");
  BRUME_ASSERT(from.references.size(), ==, to.references.size());
  const std::size_t references = std::min<std::size_t>(from.references.size(), 2);
  const Projection projection(b);
  const int columns = (a.width + options.block - 1) / options.block;
  const int rows = (a.height + options.block - 1) / options.block;
  std::vector<Block> blocks(static_cast<std::size_t>(columns) * rows);
  double points = 0, light = 0;
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * a.width + x;
      if (!(a.alpha[i] > 0.999f)) continue;
      const auto at = projection.image_of(world(a.position[i]));
      if (!at) continue;
      const Footprint found(b, *at);
      if (!is_same_surface(a, i, b, found, projection)) continue;
      Block& block =
          blocks[static_cast<std::size_t>(y / options.block) * columns + x / options.block];
      const auto light_at = [i](const FlickerFrame& frame) {
        return luminance(RgbD(frame.light[i]));
      };
      ++block.points;
      ++points;
      block.change += found.light(b) - light_at(a);
      light += light_at(references > 0 ? from.references[0] : a);
      for (std::size_t r = 0; r < references; ++r)
        block.reference_change[r] += found.light(to.references[r]) - light_at(from.references[r]);
    }

  Flicker flicker;
  flicker.matched = points / static_cast<double>(a.light.size());
  if (!(light > 0)) return flicker;
  const double mean = light / points;
  double counted = 0;
  for (const Block& block : blocks) {
    // Slivers of blocks would weigh single pixels like the others' means.
    if (block.points * 2 < options.block * options.block) continue;
    ++counted;
    const double scale = std::pow(block.points * mean, -2);
    const double first = block.reference_change[0];
    const double second = references > 1 ? block.reference_change[1] : first;
    flicker.change += scale * block.change * block.change;
    flicker.reference_change += scale * first * second;
    flicker.error_change += scale * (block.change - first) * (block.change - second);
  }
  for (double* sum : {&flicker.change, &flicker.reference_change, &flicker.error_change})
    *sum = counted > 0 ? signed_root(*sum / counted) : 0;
  return flicker;
}

}  // namespace brume
