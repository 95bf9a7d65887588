// The light at deep records: the sum over all bounces and scatterings that are asked for.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "bake/light_transport.h"

namespace brume {

struct DeepSolution {
  // Reflected up to bounces - 1 times at surfaces, up to `bounces` times in the medium, each time
  // scattered up to volume_bounces - 1 times since.
  DeepLight light;
  std::vector<RgbD> before;  // light.surface with one reflection less: what its hits reflect.
  std::vector<RgbD> reflected_fluence;  // Of volume records: what comes straight from surfaces.
  int applications = 0;                 // Of the transport operator.
  std::uint64_t strata = 0;             // That it was made of.
  int orders = 0;                       // Reflections that were added up.
  int scatterings = 0;  // Most scatterings between two of them that were added up one by one.
  bool is_accelerated = false;  // Scatterings without end were summed by GMRES instead.
  std::vector<double> changes;  // What each order added, in the mean over records, of all so far.
  double ratio = 0;             // Of the last change to the one before.
  // No record's rest, from orders that were left out, is larger than this part of its light; where
  // scattering is accelerated, of its light or a tenth of the mean. 0 where none was left out.
  double truncation_bound = 0;
};

// A solution as a journal keeps it, and back; nothing for bytes that are none.
std::vector<unsigned char> bytes_of(const DeepSolution& solution);
std::optional<DeepSolution> solution_of(std::span<const unsigned char> bytes);

// Sums orders until as many as asked for, or until the rest is bounded below 0.1 %.
//
// Each change is T times the one before, and T >= 0: where the largest ratio of a change to the one
// before is r < 1, the rest after a change d is at most d r / (1 - r) (Collatz-Wielandt), at every
// record and for every mean of them. `volume_bounces` may be kEveryOrder.
DeepSolution solve_deep_light(const LightTransport& transport,
                              const std::vector<DeepRow>& surface_rows,
                              const std::vector<DeepRow>& volume_rows, int bounces,
                              int volume_bounces);

}  // namespace brume
