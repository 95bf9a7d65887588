// K: what one more bounce or scattering makes of the light at deep records, made once of the strata
// of their gathers (docs/decisions/0008).
#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "cache/irradiance_cache.h"
#include "gather/stratum.h"
#include "gather/volume_lookup.h"

namespace brume {

// What one deep record's gather found: light that is known before the solve, and where the rest
// comes from. One number is irradiance, of surfaces; harmonic_count(order) are moments, of the
// medium.
struct DeepRow {
  std::vector<RgbD> unreflected;  // Met no surface yet: scattered once by the medium, or emitted.
  std::vector<RgbD> reflected;    // Lamps' light that the hits reflect.
  Strata strata;
  double nearest = kInfinity, error = 0;  // As gathers in the medium tell them.
  // What its record stands for, to whoever it was placed for: it need not know its surroundings
  // better. 0: it stands for nothing.
  double footprint = 0;
  double offset = 0;  // Along a surface record's normal, to where its gather looked from.

  // How far around a stratum's hit that stratum stands for: twice its width, since a row has many.
  double footprint_at(const Stratum& s) const {
    return std::max(2 * strata.spread * double(s.distance), footprint);
  }
};

// A row as a journal keeps it, and back; nothing for bytes that are no row.
std::vector<unsigned char> bytes_of(const DeepRow& row);
std::optional<DeepRow> row_of(std::span<const unsigned char> bytes);

// Irradiance of each surface record and moments of each volume record, in their caches' orders.
struct DeepLight {
  std::vector<RgbD> surface, volume;
};

// Irradiance at hits and moments at points of the medium are weighted means of the records that
// cover them, without gradients and clamps: so K is linear, keeps light that is nowhere negative
// so, and its rows sum to at most the largest albedo.
class LightTransport {
 public:
  // `surface_rows` and `volume_rows` in the order of the records of `deep`, which are all deep;
  // their strata are consumed.
  LightTransport(const World& world, const IrradianceCache& deep,
                 std::vector<DeepRow>& surface_rows, std::vector<DeepRow>& volume_rows,
                 int threads);

  // K of what surfaces reflect, from their irradiance.
  DeepLight reflect(const std::vector<RgbD>& irradiance) const;
  // K of what the medium scatters, from its moments: into the medium, and to surfaces.
  std::vector<RgbD> scatter(const std::vector<RgbD>& moments) const;
  std::vector<RgbD> scatter_to_surfaces(const std::vector<RgbD>& moments) const;

  std::size_t surface_count() const { return surface_count_; }
  std::size_t volume_count() const { return volume_count_; }
  std::size_t moment_count() const { return moments_; }
  std::size_t stratum_count() const { return stratum_count_; }
  // Of all of these, so far.
  int applications() const { return applications_; }

 private:
  struct Term {
    std::uint32_t record;
    float weight;
  };
  struct Point {
    float weight[3];
    std::uint32_t volume, terms_end;
  };
  struct Link {
    float direction[3], measure, reflectance[3];
    std::uint32_t terms_end, points_end;  // Its surface's terms come first, then each point's.
  };
  struct Row {
    std::vector<Link> links;
    std::vector<Point> points;
    std::vector<Term> terms;
  };
  // Where all media scatter evenly, directions do not matter: a row is one weight for each record
  // that any of its strata sees.
  struct Weight {
    std::uint32_t record;
    float rgb[3];
  };
  struct EvenRow {
    std::vector<Weight> surface, volume;
  };
  // Scratch memory of one thread.
  struct Sums {
    std::vector<RgbD> of;
    std::vector<std::uint32_t> touched;
    void add(std::uint32_t record, const RgbD& weight);
    std::vector<Weight> take();
  };
  Row linked(const World& world, const Vec3d& receiver, const DeepRow& of,
             const IrradianceCache& deep, const VolumeLookup& medium) const;
  // From surfaces, or from the medium where `surface` is null.
  std::vector<RgbD> at_surfaces(const std::vector<RgbD>* surface,
                                const std::vector<RgbD>* volume) const;
  std::vector<RgbD> in_medium(const std::vector<RgbD>* surface,
                              const std::vector<RgbD>* volume) const;
  EvenRow summed(const Row& row, Sums& surface, Sums& volume) const;
  static RgbD shade(const std::vector<Weight>& row, const std::vector<RgbD>& light);
  template <typename Add>
  void shade(const Row& row, const std::vector<RgbD>* surface, const std::vector<RgbD>* volume,
             const Add& add) const;

  std::vector<double> anisotropies_;  // By volume.
  int order_ = 0;
  std::size_t moments_ = 1;
  std::size_t surface_count_, volume_count_, stratum_count_ = 0;
  std::vector<Row> surface_rows_, volume_rows_;                // Of order 1 and above.
  std::vector<EvenRow> even_surface_rows_, even_volume_rows_;  // Of order 0.
  int threads_;
  mutable int applications_ = 0;
};

}  // namespace brume
