// Makes the records of one layer: where, then what a gather finds there, then how far it reaches.
#pragma once

#include <memory>
#include <vector>

#include "bake/bake.h"
#include "bake/placement.h"

namespace brume {

// What records' positions are relative to, where no cache says otherwise.
Vec3d bake_origin(const World& world);

class RecordMaker {
 public:
  // `journal`: where gathers are noted, and found instead of being made; may be null.
  RecordMaker(const Lighting& lighting, const Effects& effects, const BakeSettings& settings,
              const Vec3d& origin, int threads, CacheJournal* journal);

  // Before the first record of a layer; `sealed` holds the layers below.
  void use_layer(int layer, std::shared_ptr<const IrradianceCache> sealed);
  const BakeSettings& layer_settings() const { return layer_settings_; }

  // A record that knows where it is, and its key.
  SurfaceRecord place(const SurfacePoint& point, int layer, int wave) const;
  // The rest of a record that is placed. `offset` clears the surface; a slot is one thread's.
  void gather(double offset, SurfaceRecord& record, int slot);
  // A record close to another with a small radius must not reach far past it: R_i <= R_j + |x_i -
  // x_j| (neighbour clamping, Krivanek et al. 2006). Reads the radii of `others` and, as gathered,
  // those of `fresh`, so order plays no part.
  void clamp_by_neighbours(std::vector<SurfaceRecord>& fresh, int layer,
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
  CacheJournal* journal_;
  std::vector<Worker> workers_;
  std::shared_ptr<const IrradianceCache> sealed_;
  HitLight below_;
  BakeSettings layer_settings_;  // As the layer uses them.
};

}  // namespace brume
