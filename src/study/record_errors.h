// How far records are from the truth of their own gathers, and whether their error estimates know
// it.
#pragma once

#include <cstdint>

#include "bake/bake.h"

namespace brume {

struct RecordErrorOptions {
  int records = 2000;  // Of the top layer, spread evenly over the file; all where it holds fewer.
  std::uint64_t seed = 1;
  int threads = 0;
  // Of each truth, gathers of four times a record's cells; doubled where it is not known well
  // enough.
  int first_gathers = 4, most_gathers = 128;
};

// The truth is the mean of many gathers at the record's place that read the same deep records.
// Errors are of luminance, over the truth or 5 % of the mean truth if that is more.
struct RecordErrors {
  int records = 0;
  double mean = 0;                        // Of the truths.
  double median = 0, p99 = 0, worst = 0;  // Of the errors' sizes.
  Vec3d worst_position{0.0};
  double worst_value = 0, worst_truth = 0;
  // Rms of |record - truth| / sqrt(error^2 + truth's error^2) over records above 5 % of the mean,
  // the worst 1 % of them left out: 1 where records know their error, more where they think too
  // well of themselves.
  double calibration = 0;
  double truth_error = 0;  // Standard error of the truths, the median.
  double seconds = 0;
};

// Costs some twenty gathers for each record. Zeros without records of the top layer.
RecordErrors measure_record_errors(const Lighting& lighting, const BakeSettings& settings,
                                   const IrradianceCache& cache, const RecordErrorOptions& options);

}  // namespace brume
