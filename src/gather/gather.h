// Irradiance at a point and its gradients, from one stratified gather over the hemisphere.
//
// The gradient is form F of gradients.md 3: world-fixed shells, walls that move with 1/min(t, r),
// exact cell moments, the cosine at the wall. [JZJ08] is the talk; in vacuum it is [WH92].
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "cache/irradiance_cache.h"
#include "gather/lighting.h"
#include "gather/stratum.h"
#include "plan/effects.h"

namespace brume {

enum class GradientMode {
  None,
  WardHeckbert,  // Walls with total radiance and surface distances; knows no medium.
  Media,         // The medium moves with the point; knows no occlusion.
  Full           // Form F.
};
inline constexpr std::array kGradientModes{GradientMode::None, GradientMode::WardHeckbert,
                                           GradientMode::Media, GradientMode::Full};
const char* gradient_mode_name(GradientMode mode);
// Throws Error(Usage) listing the names.
GradientMode parse_gradient_mode(const std::string& name);

struct GatherOptions {
  int cells_theta = 20, cells_phi = 64;  // Their product counts; how the cells lie: DirectionCells.
  int shells = 0;  // 0: as many as the medium needs, at most kMaxAutomaticShells.
  // Rays march in steps as long as this share of the width that they stand for (ConeMarcher); 0:
  // cell by cell.
  double footprint = 1;
  double step_voxels = 0;  // The least step; 0: a voxel, or none at all where footprint is 0.
  // Of lights, asked for by a ray's medium; 0: one of each light from each shell.
  int lamp_samples = 4;
  GradientMode gradient = GradientMode::Full;
  // Below 0: no strata are kept. Else strata() holds them, each with at most so many points of a
  // medium that scatters more than once.
  int medium_points = -1;
  static constexpr int kMaxAutomaticShells = 32;
  int cell_count() const { return cells_theta * cells_phi; }
};

class IncidentField;

// What gather rays see that is known before the gather: where they hit a surface, and in the
// medium.
struct HitLight {
  // false: surfaces reflect nothing; only "direct": false emitters and the medium send light.
  bool reflect = true;
  // Irradiance of the next deeper layer; null: hits reflect direct light only.
  const IrradianceCache* cache = nullptr;
  int layer = 0;
  // What has scattered already and scatters again; null: the medium scatters only light straight
  // from lights.
  std::shared_ptr<const IncidentField> scattered{};
};

// What a gather asks of `layer` about what it sees: `footprint` is how far around the hit its ray
// stands for. Stretched where nobody answers, but never through a surface.
IrradianceQuery hit_query(const World& world, int layer, const Vec3d& position, const Vec3d& normal,
                          double footprint);

// Where and how to gather. `offset` clears the surface that the point lies on.
struct GatherPoint {
  Vec3d position{0.0}, normal{0.0, 0.0, 1.0};
  double offset = 0;
  std::uint64_t key = 0;  // All random numbers derive from it.
};

struct GradientTerms {
  RgbGradient radial, walls, grad_sigma, directional;
  RgbGradient sum() const { return radial + walls + grad_sigma + directional; }
};

// Gradients are per world unit.
struct GatherResult {
  RgbD irradiance, irradiance_surface, irradiance_media;
  RgbD irradiance_emitted;  // Part of irradiance_surface: emitters that only gathers see.
  GradientTerms terms;      // All zero in mode None; Ward-Heckbert has walls only.
  RgbGradient rotational;   // E(n') = E + (n x n') . rotational.
  double error = 0;         // Estimated standard error of the irradiance's luminance.
  double mean_distance =
      kInfinity;  // Harmonic mean distance of what is seen, split-sphere [WRC88].
  double light_distance = kInfinity;  // Same, weighted by the light that arrives.
  double nearest = kInfinity;         // Of the surfaces seen.
  int shells = 0;
};

// Scratch memory of one thread. The World and Lighting must outlive it.
class Gatherer {
 public:
  Gatherer(const Lighting& lighting, const Effects& effects, const GatherOptions& options);
  ~Gatherer();

  // A pure function of the world, options, point and light. Adds to `counters`.
  GatherResult gather(const GatherPoint& point, const HitLight& light, Counters& counters);

  // Gradients of another mode from the samples of the last gather(), which ran in mode Full.
  GradientTerms gradient(GradientMode mode);

  // The strata of the last gather() that other light at their hits or in the medium would change.
  const Strata& strata() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// Direct irradiance (light straight from lights) at a point of a surface, area lights with
// `samples` samples each.
RgbD direct_irradiance(const Lighting& lighting, const Vec3d& position, const Vec3d& normal,
                       int samples, std::uint64_t key, Counters& counters);

}  // namespace brume
