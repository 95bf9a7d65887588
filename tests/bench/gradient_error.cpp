// How far gradients are from the reference values, per scene, mode and number of cells: the first row of
// DESIGN 5. Not a timing, so it prints a table instead of using the benchmark library.
#include <cstdio>
#include <ctime>

#include "core/parallel.h"
#include "core/random.h"
#include "support/oracle.h"

using namespace brume;

int main(int argc, char** argv) {
  if (const auto status = run_grid_loader_child(argc, argv)) return *status;
  flush_denormals();
  std::printf("rms relative error of the tangential gradient over 32 seeds, 96 shells\n");
  std::printf("%-9s %-14s %10s %10s %10s   %s\n", "scene", "mode", "16x50", "32x101", "64x201",
              "E error, 64x201; CPU ms a gather");
  for (const OracleCase& oracle : oracle_cases()) {
    const test::LitWorld lit(make_scene(test::scene_of(oracle)));
    for (const GradientMode mode :
         {GradientMode::WardHeckbert, GradientMode::Media, GradientMode::Full}) {
      std::printf("%-9s %-14s", oracle.scene.c_str(), gradient_mode_name(mode));
      double e = 0, ms = 0;
      for (const int theta : {16, 32, 64}) {
        GatherOptions options;
        options.cells_theta = theta;
        options.cells_phi = static_cast<int>(std::lround(kPi * theta));
        options.shells = 96;
        options.gradient = mode;
        const std::clock_t start = std::clock();
        const test::GradientStatistics s = test::gather_seeds(lit, oracle, options, 32);
        ms = 1e3 * double(std::clock() - start) / CLOCKS_PER_SEC / 32;
        e = s.mean_irradiance / oracle.irradiance - 1;
        std::printf(" %10.4f", s.rms_tangential);
        std::fflush(stdout);
      }
      std::printf("   %+.4f; %.2f\n", e, ms);
    }
  }
}
