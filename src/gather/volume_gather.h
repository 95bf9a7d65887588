// What arrives at a point of the medium from all around, but straight from lights: its moments by
// direction and their gradients, from one stratified gather over the sphere (gradients.md 11: the
// terms of form F without the cosine, each weighted with the harmonic at its cell or wall).
#pragma once

#include <memory>
#include <vector>

#include "core/spherical_harmonics.h"
#include "gather/gather.h"

namespace brume {

struct VolumeGatherResult {
  // harmonic_count(order) of each; the first is the fluence [W/m^2].
  std::vector<RgbD> moments;
  std::vector<RgbD> reflected;  // Part of moments: what surfaces reflect.
  RgbD fluence_surface, fluence_media;
  double error = 0;           // Estimated standard error of the fluence's luminance.
  double nearest = kInfinity; // Of the surfaces seen.
};

// Scratch memory of one thread. The World and Lighting must outlive it.
class VolumeGatherer {
 public:
  // Moments up to `order`, at most kMaxHarmonicOrder.
  VolumeGatherer(const Lighting& lighting, const Effects& effects, const GatherOptions& options,
                 int order);
  ~VolumeGatherer();

  // A pure function of the world, options and arguments. Adds to `counters`.
  VolumeGatherResult gather(const Vec3d& position, std::uint64_t key, const HitLight& light,
                            Counters& counters);

  // The strata of the last gather() that other light at their hits or in the medium would change.
  const Strata& strata() const;
  // Gradients of the moments, per world unit, from the samples of the last gather(), which ran in mode
  // Full.
  std::vector<GradientTerms> gradients(GradientMode mode);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace brume
