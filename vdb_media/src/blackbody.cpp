// Light of a black body as a linear Rec.709 colour.
#include <array>
#include <vector>

#include "vdb_media/medium.h"

namespace brume {
namespace {

// Band of the header comment, and the step of the sum over it [nm].
constexpr double kFirstNm = 380, kLastNm = 780, kStepNm = 2;

// A lobe with its own width on either side of its peak.
double lobe(double nm, double peak, double below, double above) {
  const double x = (nm - peak) * (nm < peak ? below : above);
  return std::exp(-0.5 * x * x);
}

// CIE 1931 2-degree observer as sums of such lobes [WSS13, Eq. 4 and Table 1].
std::array<double, 3> observer(double nm) {
  return {
      1.056 * lobe(nm, 599.8, 1 / 37.9, 1 / 31.0) + 0.362 * lobe(nm, 442.0, 1 / 16.0, 1 / 26.7) -
          0.065 * lobe(nm, 501.1, 1 / 20.4, 1 / 26.2),
      0.821 * lobe(nm, 568.8, 1 / 46.9, 1 / 40.5) + 0.286 * lobe(nm, 530.9, 1 / 16.3, 1 / 31.1),
      1.217 * lobe(nm, 437.0, 1 / 11.8, 1 / 36.0) + 0.681 * lobe(nm, 459.0, 1 / 26.0, 1 / 13.8)};
}

// Planck's law [W m^-2 sr^-1 per nm]: 2 h c^2 / l^5 / (exp(h c / (l k T)) - 1), exact SI constants.
double planck(double nm, double kelvin) {
  constexpr double kH = 6.62607015e-34, kC = 299792458, kK = 1.380649e-23;
  const double l = nm * 1e-9;
  const double l5 = l * l * l * l * l;
  return 2 * kH * kC * kC / l5 / std::expm1(kH * kC / (l * kK * kelvin)) * 1e-9;
}

// Weights of the wavelengths in linear Rec.709, scaled so that luminance weighs a flat spectrum
// by the width of the band.
class Spectrum {
 public:
  Spectrum() {
    double luminance_sum = 0;
    for (double nm = kFirstNm; nm <= kLastNm; nm += kStepNm) {
      // The trapezoid rule.
      const double weight = nm == kFirstNm || nm == kLastNm ? kStepNm / 2 : kStepNm;
      const auto [x, y, z] = observer(nm);
      luminance_sum += weight * y;
      // XYZ to linear Rec.709, white D65 [IEC 61966-2-1].
      weights_.push_back(RgbD(3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
                              -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
                              0.0556434 * x - 0.2040259 * y + 1.0572252 * z) *
                         weight);
    }
    for (RgbD& w : weights_) w *= (kLastNm - kFirstNm) / luminance_sum;
  }

  RgbD blackbody(double kelvin) const {
    RgbD sum;
    for (std::size_t i = 0; i < weights_.size(); ++i)
      sum += weights_[i] * planck(kFirstNm + kStepNm * double(i), kelvin);
    // Below about 1900 K the colour lies outside Rec.709.
    return {std::max(0.0, sum.r), std::max(0.0, sum.g), std::max(0.0, sum.b)};
  }

 private:
  std::vector<RgbD> weights_;
};

// Straight lines between temperatures spaced evenly in their logarithm: good to 1e-4 at 250 K,
// where light grows with the 74th power of temperature, and to 1e-6 from 2000 K on. Built once.
class Table {
 public:
  // Below, what reaches the eye is under 1e-29 W m^-2 sr^-1: none. Above, a sum for each call.
  static constexpr double kLow = 250, kHigh = 128'000;  // [K]
  static constexpr int kPerOctave = 2048, kSize = 9 * kPerOctave;

  Table() : entries_(kSize + 1) {
    for (int i = 0; i <= kSize; ++i)
      entries_[i] = Rgb(spectrum_.blackbody(kLow * std::exp2(double(i) / kPerOctave)));
    // The tails of the observer's lobes give the dullest reds 1e-15 of blue that fades as they
    // brighten. Light grows with temperature.
    for (int i = kSize; i-- > 0;)
      for (int c = 0; c < 3; ++c) entries_[i][c] = std::min(entries_[i][c], entries_[i + 1][c]);
  }

  Rgb at(double kelvin) const {
    if (!(kelvin > kLow)) return Rgb();
    if (kelvin >= kHigh) return Rgb(spectrum_.blackbody(std::min(kelvin, 1e15)));
    const double x = std::log2(kelvin / kLow) * kPerOctave;
    const int i = std::min(int(x), kSize - 1);
    const float f = float(x - i);
    return entries_[i] + (entries_[i + 1] - entries_[i]) * f;
  }

 private:
  Spectrum spectrum_;
  std::vector<Rgb> entries_;
};

}  // namespace

Rgb blackbody_radiance(double kelvin) {
  static const Table table;
  return table.at(kelvin);
}

}  // namespace brume
