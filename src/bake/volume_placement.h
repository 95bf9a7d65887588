// Deep records of the medium: where, what a gather finds there, and how far each reaches.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <vector>

#include "bake/bake.h"
#include "bake/light_transport.h"
#include "gather/volume_gather.h"

namespace brume {

// The degree up to which moments are kept, so that what is left out of a phase function's series,
// |g|^(order + 1), is small: 0 for even scattering, 1 to |g| = 0.3, 3 to 0.55, kMaxHarmonicOrder
// above.
int harmonic_order(const Medium& medium);

// How far a record of the medium at p may reach along x, y and z, before cells are cut where light
// changes: world units.
Vec3d volume_record_radii(const Lighting& lighting, const Vec3d& p);

// A record in the middle of each cell of a tree over the medium. Light between records is linear,
// so a cell is halved along an axis while it is longer there than light is near linear over: in
// optical depth from the medium's edges and from surfaces, where it falls off steeply, in distance
// from surfaces and lamps elsewhere. Then, wave by wave, a cell is cut into eight where the light
// that its gather found, of first order, is not what its neighbours make of it, and that matters:
// by what the cell scatters of all that is scattered. Where hardly any of the light that crosses
// the surroundings scatters there, as in haze and between things that nearly touch, cells are wider
// and cut less. A pure function of the scene and the settings; never of views.
class VolumePlacement {
 public:
  // Everything must outlive it. `settings` as deep records use them. `journal` may be null.
  VolumePlacement(const Lighting& lighting, const BakeSettings& settings, const Effects& effects,
                  const Vec3d& origin, int threads, CacheJournal* journal);

  // False where `is_stopped` says so first.
  bool place(const std::function<bool()>& is_stopped);

  // In VolumeRecordOrder, their light not yet known.
  const VolumeRecords& records() const { return records_; }
  std::vector<DeepRow>& rows() { return rows_; }
  const std::vector<DeepRow>& rows() const { return rows_; }
  // Of light that crosses a record's surroundings, about which part scatters there; as records().
  double share(std::size_t record) const { return sites_[record].share; }
  const Counters& counters() const { return counters_; }

 private:
  struct Site {
    Vec3d position{0.0};
    Box3d cell;
    double scattering = 0, densest = 0;  // Over the cell: mean of sigma_s, most of sigma_t.
    double share = 1;
  };
  std::optional<Site> site_of(const Box3d& cell) const;
  // `placed` counts the sites of all cells; what would be too many is not gone on with.
  void cut(const Box3d& cell, double scale, int depth, std::atomic<std::size_t>& placed,
           std::vector<Site>& sites) const;
  std::vector<Site> first_sites(double scale) const;
  // What a record's gather finds, or found in an earlier run: its row, clearance and error.
  bool find(VolumeRecord& record, DeepRow& row) const;
  void gather_one(VolumeGatherer& gatherer, VolumeRecord& record, DeepRow& row,
                  Counters& counters) const;
  bool gather(const std::vector<Site>& sites, int wave, const std::function<bool()>& is_stopped);
  std::vector<Site> cut_where_light_changes();
  void sort();

  const Lighting& lighting_;
  const World& world_;
  BakeSettings settings_;
  Effects effects_;
  Vec3d origin_;
  int threads_, order_;
  CacheJournal* journal_;
  Box3d box_;
  VolumeRecords records_;
  std::vector<DeepRow> rows_;  // As records_.
  std::vector<Site> sites_;
  Counters counters_;
};

}  // namespace brume
