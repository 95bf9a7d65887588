#include "study/metrics.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "study/flip.h"

namespace brume {
namespace {

std::vector<double> luminances(const std::vector<Rgb>& image, const char* which, int width) {
  std::vector<double> l(image.size());
  for (std::size_t i = 0; i < image.size(); ++i) {
    l[i] = luminance(RgbD(image[i]));
    if (std::isfinite(l[i])) continue;
    const auto w = static_cast<std::size_t>(width);
    const std::string x = std::to_string(i % w), y = std::to_string(i / w);
    throw Error(ErrorKind::InvalidInput, std::string(which) + " image: pixel (" + x + ", " + y +
                                             ") is not finite: compare images without such pixels");
  }
  return l;
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

// numerator / denominator, with 0/0 = 0 and the sign kept in infinities.
double ratio(double numerator, double denominator) {
  return numerator == 0 ? 0 : numerator / denominator;
}

void check_sizes(const std::vector<Rgb>& a, const std::vector<Rgb>& b, int width, int height) {
  const std::size_t pixels = width > 0 && height > 0 ? std::size_t(width) * std::size_t(height) : 0;
  if (pixels == 0 || a.size() != pixels || b.size() != pixels)
    throw Error(ErrorKind::InvalidInput,
                "images of " + std::to_string(a.size()) + " and " + std::to_string(b.size()) +
                    " pixels: only images of one size can be compared: render both at one size");
}

}  // namespace

DifferenceMap compare_images(const std::vector<Rgb>& a, const std::vector<Rgb>& b, int width,
                             int height) {
  check_sizes(a, b, width, height);
  const std::vector<double> la = luminances(a, "the first", width), lb = luminances(b, "the second", width);
  const double mean_a = mean(la), mean_b = mean(lb);
  const auto count = static_cast<double>(la.size());

  DifferenceMap map;
  ImageDifference& n = map.numbers;
  map.relative.resize(la.size());
  std::vector<double> absolute(la.size());
  for (std::size_t i = 0; i < la.size(); ++i) {
    const double d = la[i] - lb[i];
    const double scale2 = lb[i] * lb[i] + (0.01 * mean_b) * (0.01 * mean_b);
    absolute[i] = std::abs(d);
    n.mae += absolute[i];
    n.rmse += d * d;
    n.relmse += ratio(d * d, scale2);
    n.max = std::max(n.max, absolute[i]);
    map.relative[i] = static_cast<float>(ratio(d, std::sqrt(scale2)));
  }
  n.mae /= count;
  n.rmse = std::sqrt(n.rmse / count);
  n.relmse /= count;
  n.signed_mean = ratio(mean_a - mean_b, mean_b);

  // Nearest rank: 99 % of the pixels are at most this far off.
  const auto rank = static_cast<std::ptrdiff_t>(std::ceil(0.99 * count)) - 1;
  std::nth_element(absolute.begin(), absolute.begin() + rank, absolute.end());
  n.p99 = absolute[static_cast<std::size_t>(rank)];

  // One exposure for both, from the reference, so that a difference in brightness is seen.
  const float exposure = mean_b > 0 ? static_cast<float>(0.18 / mean_b) : 1.0f;
  const auto exposed = [exposure](std::vector<Rgb> image) {
    for (Rgb& c : image) c *= exposure;
    return image;
  };
  map.flip = flip_map(exposed(a), exposed(b), width, height);
  for (const float f : map.flip) n.flip += f;
  n.flip /= count;
  return map;
}

double block_nrmse(const std::vector<Rgb>& a, const std::vector<Rgb>& b, int width, int height,
                   int block) {
  check_sizes(a, b, width, height);
  const int across = block > 0 ? width / block : 0, down = block > 0 ? height / block : 0;
  if (across == 0 || down == 0)
    throw Error(ErrorKind::InvalidInput, "blocks of " + std::to_string(block) + " pixels: the image is " +
                                             std::to_string(width) + "x" + std::to_string(height));
  const std::vector<double> la = luminances(a, "the first", width), lb = luminances(b, "the second", width);
  double squares = 0;
  for (int by = 0; by < down; ++by)
    for (int bx = 0; bx < across; ++bx) {
      double d = 0;
      for (int y = by * block; y < (by + 1) * block; ++y)
        for (int x = bx * block; x < (bx + 1) * block; ++x) {
          const std::size_t i = std::size_t(y) * width + x;
          d += la[i] - lb[i];
        }
      d /= double(block) * block;
      squares += d * d;
    }
  return ratio(std::sqrt(squares / (double(across) * down)), mean(lb));
}

}  // namespace brume
