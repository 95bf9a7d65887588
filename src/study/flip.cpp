#include "study/flip.h"

#include <array>

#include "core/error.h"

namespace brume {
namespace {

// One plane a channel.
struct Planes {
  std::array<std::vector<double>, 3> plane;
  explicit Planes(std::size_t pixels) {
    for (auto& p : plane) p.resize(pixels);
  }
};

// ---- colour spaces -------------------------------------------------------------------------------

// Linear Rec.709 to CIE XYZ, and its inverse (IEC 61966-2-1, unrounded).
constexpr double kToXyz[3][3] = {{0.41239079926595934, 0.35758433938387801, 0.18048078840183430},
                                 {0.21263900587151027, 0.71516867876775602, 0.07219231536073371},
                                 {0.01933081871559182, 0.11919477979462598, 0.95053215224966069}};
constexpr double kFromXyz[3][3] = {{3.2409699419045226, -1.5373831775700939, -0.4986107602930034},
                                   {-0.9692436362808796, 1.8759675015077202, 0.0415550574071756},
                                   {0.0556300796969936, -0.2039769588889766, 1.0569715142428786}};

using Triple = std::array<double, 3>;

Triple apply(const double (&m)[3][3], const Triple& v) {
  Triple r{};
  for (std::size_t i = 0; i < 3; ++i) r[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
  return r;
}

// XYZ of white, over which XYZ is taken: D65 as (1, 1, 1) in Rec.709 gives it.
const Triple& white() {
  static const Triple w = apply(kToXyz, {1, 1, 1});
  return w;
}

Triple relative_xyz(const Triple& rgb) {
  Triple xyz = apply(kToXyz, rgb);
  for (std::size_t k = 0; k < 3; ++k) xyz[k] /= white()[k];
  return xyz;
}

// The linear opponent space of [ANAM*20, Section 4.1.1]: lightness, red-green, blue-yellow.
Triple ycxcz(const Triple& rgb) {
  const Triple t = relative_xyz(rgb);
  return {116 * t[1] - 16, 500 * (t[0] - t[1]), 200 * (t[1] - t[2])};
}

Triple rgb_of_ycxcz(const Triple& c) {
  const double y = (c[0] + 16) / 116;
  return apply(kFromXyz,
               {(y + c[1] / 500) * white()[0], y * white()[1], (y - c[2] / 200) * white()[2]});
}

// CIE L*a*b*, its chroma scaled by lightness: colour differences count for less in the dark (the Hunt
// effect, [ANAM*20, Section 4.1.2]).
Triple hunt_lab(const Triple& rgb) {
  const auto f = [](double t) {
    constexpr double kDelta = 6.0 / 29;
    return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3 * kDelta * kDelta) + 4.0 / 29;
  };
  const Triple t = relative_xyz(rgb);
  const double l = 116 * f(t[1]) - 16;
  return {l, 0.01 * l * 500 * (f(t[0]) - f(t[1])), 0.01 * l * 200 * (f(t[1]) - f(t[2]))};
}

// City block in lightness, Euclidean in chroma.
double hyab(const Triple& a, const Triple& b) {
  return std::abs(a[0] - b[0]) + std::hypot(a[1] - b[1], a[2] - b[2]);
}

// ---- filters -------------------------------------------------------------------------------------

// A kernel of 2 radius + 1 taps, its middle at [radius].
using Kernel = std::vector<double>;

template <typename F>
Kernel sampled(int radius, F f) {
  Kernel k;
  for (int x = -radius; x <= radius; ++x) k.push_back(f(static_cast<double>(x)));
  return k;
}

// rows: along x, else along y. Beyond the border the edge pixel repeats.
std::vector<double> convolved(const std::vector<double>& in, int width, int height, const Kernel& kernel,
                              bool rows) {
  const int radius = static_cast<int>(kernel.size() / 2);
  std::vector<double> out(in.size());
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      double sum = 0;
      for (int i = -radius; i <= radius; ++i) {
        const int sx = rows ? std::clamp(x + i, 0, width - 1) : x;
        const int sy = rows ? y : std::clamp(y + i, 0, height - 1);
        sum += kernel[static_cast<std::size_t>(i + radius)] * in[std::size_t(sy) * width + sx];
      }
      out[std::size_t(y) * width + x] = sum;
    }
  return out;
}

std::vector<double> convolved(const std::vector<double>& in, int width, int height, const Kernel& along_x,
                              const Kernel& along_y) {
  return convolved(convolved(in, width, height, along_x, true), width, height, along_y, false);
}

// The contrast sensitivity of a channel as a sum of Gaussians, transformed to the image plane
// [ANAM*20, Section 4.1.1, Table 1]: g(d) = sum a sqrt(pi / b) exp(-pi^2 d^2 / b), d in degrees.
struct Sensitivity {
  double a1, b1, a2, b2;
};
constexpr Sensitivity kSensitivity[3] = {
    {1, 0.0047, 0, 1e-5}, {1, 0.0053, 0, 1e-5}, {34.1, 0.04, 13.5, 0.025}};
constexpr double kWidestB = 0.04;

// Removes what an eye at this distance cannot see. Each Gaussian is separable, their sum is not.
std::vector<double> seen(const std::vector<double>& in, int width, int height, const Sensitivity& s,
                         double pixels_per_degree) {
  const int radius = static_cast<int>(std::ceil(3 * std::sqrt(kWidestB / (2 * kPi * kPi)) * pixels_per_degree));
  std::vector<double> out(in.size());
  double total = 0;
  for (const auto& [a, b] : {std::pair(s.a1, s.b1), std::pair(s.a2, s.b2)}) {
    if (a == 0) continue;
    const Kernel k = sampled(radius, [&, b_ = b](double x) {
      const double d = x / pixels_per_degree;
      return std::exp(-kPi * kPi * d * d / b_);
    });
    double sum = 0;
    for (const double v : k) sum += v;
    const double weight = a * std::sqrt(kPi / b);
    total += weight * sum * sum;
    const std::vector<double> part = convolved(in, width, height, k, k);
    for (std::size_t i = 0; i < out.size(); ++i) out[i] += weight * part[i];
  }
  for (double& v : out) v /= total;
  return out;
}

// ---- features ------------------------------------------------------------------------------------

// Positive weights sum to 1, negative ones to -1.
Kernel balanced(Kernel k) {
  double positive = 0, negative = 0;
  for (const double v : k) (v > 0 ? positive : negative) += v;
  for (double& v : k) v /= v > 0 ? positive : -negative;
  return k;
}

struct Features {
  std::vector<double> edges, points;
};

// Strength of edges and of points: first and second derivatives of a Gaussian as wide as an edge that
// is seen as one, w = 0.082 degrees [ANAM*20, Section 4.2.1].
Features features_of(const std::vector<double>& grey, int width, int height, double pixels_per_degree) {
  const double sigma = 0.5 * 0.082 * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  const auto gauss = [&](double x) { return std::exp(-x * x / (2 * sigma * sigma)); };
  Kernel smooth = sampled(radius, gauss);
  double sum = 0;
  for (const double v : smooth) sum += v;
  for (double& v : smooth) v /= sum;
  const Kernel first = balanced(sampled(radius, [&](double x) { return -x * gauss(x); }));
  const Kernel second =
      balanced(sampled(radius, [&](double x) { return (x * x / (sigma * sigma) - 1) * gauss(x); }));

  const auto strength = [&](const Kernel& k) {
    std::vector<double> x = convolved(grey, width, height, k, smooth);
    const std::vector<double> y = convolved(grey, width, height, smooth, k);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::hypot(x[i], y[i]);
    return x;
  };
  return {strength(first), strength(second)};
}

// ---- the parts -----------------------------------------------------------------------------------

struct Prepared {
  Planes lab;         // What is seen, Hunt-adjusted.
  Features features;
};

Prepared prepare(const std::vector<Rgb>& image, int width, int height, double pixels_per_degree) {
  Planes opponent(image.size());
  std::vector<double> grey(image.size());
  for (std::size_t i = 0; i < image.size(); ++i) {
    Triple rgb{};
    for (int k = 0; k < 3; ++k) rgb[static_cast<std::size_t>(k)] = std::clamp(double(image[i][k]), 0.0, 1.0);
    const Triple c = ycxcz(rgb);
    for (std::size_t k = 0; k < 3; ++k) opponent.plane[k][i] = c[k];
    grey[i] = (c[0] + 16) / 116;
  }
  Features features = features_of(grey, width, height, pixels_per_degree);
  for (std::size_t k = 0; k < 3; ++k)
    opponent.plane[k] = seen(opponent.plane[k], width, height, kSensitivity[k], pixels_per_degree);
  for (std::size_t i = 0; i < image.size(); ++i) {
    Triple rgb = rgb_of_ycxcz({opponent.plane[0][i], opponent.plane[1][i], opponent.plane[2][i]});
    for (double& v : rgb) v = std::clamp(v, 0.0, 1.0);
    const Triple lab = hunt_lab(rgb);
    for (std::size_t k = 0; k < 3; ++k) opponent.plane[k][i] = lab[k];
  }
  return {std::move(opponent), std::move(features)};
}

// Compresses large colour differences, then maps [0, cmax] to [0, 1] so that the lower 40 % take 95 %
// of it [ANAM*20, Section 4.1.4]; cmax is the distance of Rec.709's green and blue.
double colour_error(double distance) {
  constexpr double kExponent = 0.7, kCut = 0.4, kCutError = 0.95;
  static const double cmax = std::pow(hyab(hunt_lab({0, 1, 0}), hunt_lab({0, 0, 1})), kExponent);
  const double d = std::pow(distance, kExponent), cut = kCut * cmax;
  if (d < cut) return kCutError * d / cut;
  return kCutError + (1 - kCutError) * (d - cut) / (cmax - cut);
}

}  // namespace

std::vector<float> flip_map(const std::vector<Rgb>& a, const std::vector<Rgb>& b, int width, int height,
                            double pixels_per_degree) {
  const std::size_t pixels = std::size_t(width) * height;
  BRUME_ASSERT(a.size(), ==, pixels);
  BRUME_ASSERT(b.size(), ==, pixels);
  const Prepared pa = prepare(a, width, height, pixels_per_degree);
  const Prepared pb = prepare(b, width, height, pixels_per_degree);
  std::vector<float> map(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const auto lab = [i](const Prepared& p) {
      return Triple{p.lab.plane[0][i], p.lab.plane[1][i], p.lab.plane[2][i]};
    };
    const double colour = colour_error(hyab(lab(pa), lab(pb)));
    const double feature = std::max(std::abs(pa.features.edges[i] - pb.features.edges[i]),
                                    std::abs(pa.features.points[i] - pb.features.points[i]));
    // [ANAM*20, Sections 4.2.2 and 4.3], with exponent 0.5.
    const double feature_error = std::min(1.0, std::sqrt(feature / std::sqrt(2.0)));
    map[i] = static_cast<float>(std::min(1.0, std::pow(colour, 1 - feature_error)));
  }
  return map;
}

}  // namespace brume
