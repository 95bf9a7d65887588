// The finest waves of a layer, cut into cells of space that are baked each by itself: a cell reads
// the waves before and its own records, never another cell's. Which cells there are depends on the
// scene and what is to be covered alone, so any thread, shard or later run may bake any of them
// (docs/decisions/0001).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "bake/placement.h"
#include "cache/record.h"

namespace brume {

// A place where a record may go, as it would be stored.
struct Candidate {
  std::uint64_t cell = 0;
  double offset = 0;  // Clears the surface.
  float position[3] = {}, normal[3] = {};
  float min_radius = 0;
  std::uint32_t batch =
      0;  // Index into the batches; those of a cell are baked one after the other.
};

// Candidates of one wave (and view).
struct CandidateBatch {
  int wave = 0;
  double thinned_to =
      0;  // Distance to keep from each other; 0: they are far enough apart as they are.
};

// One cell's candidates, by batch.
using WorkUnit = std::span<const Candidate>;

class WorkUnits {
 public:
  // `origin`: what positions of records are relative to. `unit`: metres of a world unit.
  WorkUnits(const Vec3d& origin, double unit) : origin_(origin), unit_(unit) {}

  std::uint32_t add_batch(const CandidateBatch& batch);
  // `resolution`: how far apart records may be needed at `point`. Cells are about as many of them
  // wide everywhere, so that near and far surfaces make units of equal work.
  void add(std::uint32_t batch, const SurfacePoint& point, double resolution);
  // After the last add(): the units, in an order that depends on what was added alone.
  std::vector<WorkUnit> units();

  const CandidateBatch& batch(std::uint32_t i) const { return batches_[i]; }

 private:
  Vec3d origin_;
  double unit_;
  std::vector<CandidateBatch> batches_;
  std::vector<Candidate> candidates_;
};

// The key of a record at that place: of position, in metres by `unit`, and normal alone, so that
// layers that choose the same point share its random numbers, and what changes from one to the next
// is light, not noise.
std::uint64_t record_key(const float* position, const float* normal, double unit);

}  // namespace brume
