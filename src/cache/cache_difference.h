// How two caches differ: record by record where keys agree, and in what they answer.
#pragma once

#include <cstddef>
#include <optional>

#include "cache/cache_file.h"

namespace brume {

struct CacheDifference {
  // Records are the same one where layer and key agree. `equal` ones agree in every bit but
  // kUnfinishedViewFlag, which tells of the bake and not of the record.
  std::size_t only_a = 0, only_b = 0, equal = 0, different = 0;

  // Over the records in both, of luminance, B being the reference; relative to B's mean. Nothing
  // where there are none.
  struct Values {
    double mae = 0, rmse = 0, relmse = 0, signed_mean = 0, p99 = 0, max = 0;  // Irradiance [W/m^2].
    double gradient_rmse = 0;  // |grad A - grad B| over the root mean square of |grad B|.
    double radius_rmse = 0;    // Of log(radius A / radius B).
  };
  std::optional<Values> values;

  // What A answers at the places of B's records in the highest layer of B, against those records:
  // with other settings no keys may agree, and still both should give the same light.
  struct Answers {
    std::size_t points = 0, uncovered = 0;
    double bias = 0, rmse = 0;  // Over the mean of B there.
  };
  Answers answers;
};

CacheDifference compare_caches(const CacheContents& a, const CacheContents& b);

}  // namespace brume
