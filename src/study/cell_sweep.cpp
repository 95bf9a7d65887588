#include "study/cell_sweep.h"

#include <ctime>

namespace brume {
namespace {

constexpr std::array kSweep{4, 8, 16, 32, 64, 128};  // Cells in theta.

struct Sample {
  RgbD irradiance;
  std::array<Vec3d, kGradientModes.size()> gradient;  // Of luminance.
};

}  // namespace

std::vector<CellSweepRow> sweep_cells(const Lighting& lighting, const Effects& effects,
                                      const GatherPoint& at, const HitLight& below,
                                      const GatherOptions& options,
                                      std::span<const std::uint64_t> keys) {
  const double n = double(keys.size());
  std::vector<CellSweepRow> rows;
  std::vector<std::vector<Sample>> samples;
  for (const int theta : kSweep) {
    CellSweepRow row;
    row.gradient.fill(Vec3d(0.0));
    row.cells_theta = theta;
    row.cells_phi = static_cast<int>(std::lround(kPi * theta));
    GatherOptions o = options;
    o.cells_theta = row.cells_theta;
    o.cells_phi = row.cells_phi;
    o.gradient = GradientMode::Full;
    Gatherer gatherer(lighting, effects, o);
    Counters counters;
    std::clock_t spent = 0;
    samples.emplace_back();
    for (const std::uint64_t key : keys) {
      GatherPoint point = at;
      point.key = key;
      Sample s;
      const std::clock_t start = std::clock();
      s.irradiance = gatherer.gather(point, below, counters).irradiance;
      spent += std::clock() - start;
      for (std::size_t m = 0; m < kGradientModes.size(); ++m) {
        s.gradient[m] = luminance(gatherer.gradient(kGradientModes[m]).sum());
        row.gradient[m] += s.gradient[m] / n;
      }
      row.irradiance += s.irradiance / n;
      samples.back().push_back(s);
    }
    row.seconds = double(spent) / CLOCKS_PER_SEC / n;
    rows.push_back(row);
  }

  const double truth = luminance(rows.back().irradiance);
  const Vec3d gradient = rows.back().gradient_of(GradientMode::Full);
  const double slope = gradient.length();
  for (std::size_t r = 0; r < rows.size(); ++r) {
    double squares = 0;
    std::array<double, kGradientModes.size()> of_mode{};
    for (const Sample& s : samples[r]) {
      squares += std::pow(luminance(s.irradiance) - truth, 2) / n;
      for (std::size_t m = 0; m < of_mode.size(); ++m)
        of_mode[m] += (s.gradient[m] - gradient).length2() / n;
    }
    rows[r].irradiance_rms = truth > 0 ? std::sqrt(squares) / truth : 0;
    for (std::size_t m = 0; m < of_mode.size(); ++m)
      rows[r].gradient_rms[m] = slope > 0 ? std::sqrt(of_mode[m]) / slope : 0;
  }
  return rows;
}

}  // namespace brume
