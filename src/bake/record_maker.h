// Makes records: where, then what a gather finds there, then how far it reaches.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "bake/bake.h"
#include "bake/placement.h"

namespace brume {

// What records' positions are relative to, where no cache says otherwise.
Vec3d bake_origin(const World& world);

// What an earlier run's gather found at `record`, which is placed, if a journal holds it; false
// where it must be gathered.
bool recall(const CacheJournal* journal, SurfaceRecord& record);

class RecordMaker {
 public:
  RecordMaker(const Lighting& lighting, const Effects& effects, const BakeSettings& settings,
              const Vec3d& origin, int threads);

  // A record that knows where it is, and its key.
  SurfaceRecord place(const SurfacePoint& point, int layer, int wave) const;
  // The rest of a record that is placed. `offset` clears the surface; a slot is one thread's.
  GatherResult gather(double offset, const HitLight& light, SurfaceRecord& record, int slot);
  // Of the slot's last gather.
  const Strata& strata(int slot) const {
    return workers_[static_cast<std::size_t>(slot)].gatherer->strata();
  }
  // A record close to another with a small radius must not reach far past it: R_i <= R_j + |x_i -
  // x_j| (neighbour clamping, Krivanek et al. 2006). Reads the radii of `others` and, as gathered,
  // those of `fresh`, so order plays no part.
  void clamp_by_neighbours(std::span<SurfaceRecord> fresh, int layer,
                           std::vector<const IrradianceCache*> others) const;

  Counters counters() const;

 private:
  struct Worker {
    std::unique_ptr<Gatherer> gatherer;
    Counters counters;
  };

  const Lighting& lighting_;
  const Effects& effects_;
  const BakeSettings& settings_;
  Vec3d origin_;
  int threads_;
  std::vector<Worker> workers_;
};

}  // namespace brume
