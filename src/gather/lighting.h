// Light straight from lights, dimmed by the medium: at surfaces and at points of the medium.
//
// Visibility and optical depth are separate (DESIGN 4.4): visibility is traced, optical depth comes from
// light volumes or, with LightDepth::Exact, from marching.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "plan/effects.h"
#include "scene/world.h"
#include "vdb_media/light_volume.h"
#include "vdb_media/ray_marcher.h"

namespace brume {

class BrightPatches;
class DepthMarcher;

enum class LightDepth { Volumes, Exact };

// From p to just short of the light, whose own surface must not shadow it.
inline ShadowRay shadow_ray(const Vec3d& p, const LightSample& sample) {
  return {p, sample.direction, sample.distance * (1 - 1e-5)};
}

struct LightingOptions {
  LightDepth depth = LightDepth::Volumes;
  double target_error = 0.01;  // Of transmittance, rms, for each point light's volume; area lights' twice.
  MarchOptions march{};
  int threads = 0;
};

// Immutable once built, shared by all threads. Area lights have a table for each of nine patches;
// environments have none.
class Lighting {
 public:
  Lighting(const World& world, const LightingOptions& options);
  ~Lighting();

  const World& world() const { return world_; }
  const MarchOptions& march() const { return options_.march; }

  const BrightPatches& bright_patches() const { return *patches_; }

  // Transmittance from p to the light along its sample; visibility is not in it.
  RgbD transmittance(int light, const LightSample& sample, const Vec3d& p, Counters& counters) const;
  // The same for many, for less: those to lights without tables are marched sixteen at once, in steps
  // of two voxels.
  struct Request {
    int light;
    LightSample sample;
    Vec3d p;
  };
  void transmittances(std::span<const Request> requests, std::span<RgbD> found, Counters& counters) const;
  // Depths of the medium along rays to their ends, the same way.
  void optical_depths(std::span<const Ray> rays, std::span<const double> ends,
                      std::span<RgbD> depths) const;
  // One, marched whatever the options say: for what eyes see directly.
  RgbD exact_transmittance(const LightSample& sample, const Vec3d& p, Counters& counters) const {
    return world_.medium().is_vacuum() ? RgbD(1) : exp_neg(exact_depth(sample, p, counters));
  }

  // Error of the transmittance that light arrives with, over random points of the medium, against
  // marching; area lights and environments averaged over their samples. 0 where all is marched
  // exactly. Measured when built.
  double rms_error() const { return rms_error_; }
  double max_error() const { return max_error_; }
  std::size_t memory_bytes() const;

 private:
  struct Table {
    Vec3d centre;  // Of the light's patch.
    std::vector<std::unique_ptr<LightVolume>> volumes;  // By volume; null for homogeneous ones.
  };
  const Table& table(int light, const Vec3d& point_on_light) const;
  RgbD tabulated(int light, const LightSample& sample, const Vec3d& p, Counters& counters) const;
  RgbD exact_depth(const LightSample& sample, const Vec3d& p, Counters& counters) const;
  Box3d table_box() const;
  void measure_error();

  const World& world_;
  LightingOptions options_;
  std::shared_ptr<const BrightPatches> patches_;
  std::vector<Box3d> boxes_;                // Of the volumes' density, by volume.
  std::vector<std::vector<Table>> tables_;  // By light; empty: marched.
  std::vector<std::unique_ptr<DepthMarcher>> marchers_;  // By volume; null for homogeneous ones.
  double rms_error_ = 0, max_error_ = 0;
};

}  // namespace brume
