// The bounces of light between deep records: K, made once of the strata of their gathers, and the sum
// over its powers (docs/decisions/0008).
#pragma once

#include <vector>

#include "bake/bake.h"
#include "gather/stratum.h"

namespace brume {

// What one deep record's gather found: light that is known before the solve, and where the rest comes
// from.
struct DeepRow {
  RgbD unreflected;  // Irradiance that met no surface yet: scattered by the medium, emitted.
  RgbD reflected;    // Lamps' light that the hits reflect.
  std::vector<Stratum> strata;
};

// Irradiance of each deep record, in the cache's order.
using DeepLight = std::vector<RgbD>;

// K: the irradiance that records receive from what their hits reflect. Each hit takes the weighted
// mean of the records that cover it, without gradients and clamps, so K is linear, K >= 0, and its
// rows sum to at most the largest albedo.
class SurfaceTransport {
 public:
  // `rows` in the order of the cache's records, which are all of kDeepLayer; their strata are
  // consumed. Records act as if at least `min_radius` wide.
  SurfaceTransport(const IrradianceCache& deep, std::vector<DeepRow>& rows, double min_radius,
                   int threads);
  DeepLight apply(const DeepLight& light) const;
  std::size_t stratum_count() const;

 private:
  struct Term {
    std::uint32_t record;
    float weight;
  };
  struct Link {
    float factor[3];  // Measure * reflectance.
    std::uint32_t end;  // Of its terms; they begin where those of the link before end.
  };
  struct Row {
    std::vector<Link> links;
    std::vector<Term> terms;
  };
  std::vector<Row> rows_;
  int threads_;
};

struct DeepSolution {
  DeepLight light;   // Reflected up to bounces - 1 times.
  DeepLight before;  // One reflection less: what `light` is the gather of.
  int orders = 0;    // Reflections that were added up.
  // No record's rest, from reflections up to `bounces` - 1 that were left out, is larger than this part
  // of its light. 0 where none was left out.
  double truncation_bound = 0;
};

// Sums orders until `bounces` - 1, or until the rest is bounded below 0.1 % of each record's light.
//
// Each change is K times the one before, and K >= 0: where the largest ratio of a change to the one
// before is r < 1, the rest after a change d is at most d r / (1 - r) (Collatz-Wielandt), at every
// record and for every mean of them.
DeepSolution solve_deep_light(const SurfaceTransport& transport, const std::vector<DeepRow>& rows,
                              int bounces);

}  // namespace brume
