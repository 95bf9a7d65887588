// Sums the scatterings of light in the medium between two reflections: (1 + K + K^2 + ...) s.
#pragma once

#include <functional>
#include <vector>

#include "bake/light_transport.h"

namespace brume {

class ScatteringSolve {
 public:
  // At most `limit` terms; fewer where the rest is bounded below `tolerance` of each record's
  // fluence, that of earlier sums included: what a late bounce leaves is small beside all before
  // it. `transport` must outlive it.
  ScatteringSolve(const LightTransport& transport, int limit, double tolerance);

  // The sum for moments `source` of light that has just arrived; adds what all of it sends to
  // surfaces to `surface`. Where the series converges slowly and no limit matters, GMRES [SS86]
  // solves (1 - K) m = s instead: an optical depth of 30 of white smoke needs 1,600 plain terms.
  std::vector<RgbD> sum(std::vector<RgbD> source, std::vector<RgbD>& surface);

  int orders() const { return orders_; }  // The most terms of any sum().
  bool is_accelerated() const { return is_accelerated_; }
  // All rests that sum() left together, relative as DeepSolution says.
  double bound() const { return bound_; }

 private:
  using Light = std::vector<RgbD>;

  // Plain terms, added to `sum` and last in `term`; false where they converge slowly.
  bool add_terms(Light& sum, Light& term);
  void accelerate(const Light& source, Light& sum, Light residual);
  using IsEnough = std::function<bool(const Light& light, const Light& residual)>;
  // A cycle of GMRES from `light`, whose residual is `residual`; asks every few steps whether what
  // it has found is enough.
  void improve(Light& light, Light& residual, const IsEnough& is_enough);
  double bound_of(const Light& light, const Light& residual) const;
  void finish(const Light& sum, double bound);
  void find_majorant();

  const LightTransport& transport_;
  int limit_;
  double tolerance_;
  int orders_ = 0;
  bool is_accelerated_ = false;
  double bound_ = 0;
  Light all_;                     // Of all sums so far.
  Light last_source_, last_sum_;  // Of the last accelerated sum: a start for the next.
  // w > 0 whose d = w - K w > 0 too: where x - K x = r, |x| is at most w max(|r| / d).
  Light majorant_, majorant_source_;
};

}  // namespace brume
