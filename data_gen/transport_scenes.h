// Scenes whose answers contain every order of scattering: a slab, whose reflection and transmission
// are known [vdH80], and a furnace, which looks like its environment.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "core/math.h"

namespace brume {

// A homogeneous slab of thickness 1, 0 <= y <= 1, lit from above so that a white receiver facing
// the full light shows radiance 1. Two such receivers, far smaller than their distance of 0.05 to
// the slab, face it from above and from below: they show the parts of the light that the slab
// reflects and lets through, scattered light as indirect, the rest as direct.
struct SlabOptions {
  enum class Incidence {
    Normal,  // A beam along -y.
    Diffuse  // The same radiance from all directions above.
  };
  double optical_depth = 1, albedo = 1, anisotropy = 0;  // The depth along y.
  Incidence incidence = Incidence::Normal;
  // Over the thickness; nothing: default_slab_width(). A narrower slab loses light through its
  // sides.
  std::optional<double> width;
  // 0: a box. n: a grid of n nodes along each axis, voxels as oblong as the slab. Its density falls
  // to 0 over the outermost voxel, above and below within the slab (its optical depth alone
  // matters), to the sides beyond `width`.
  int resolution = 0;
};

// max(20, 12 / (optical_depth min(1, 1 - g))). Reflection and transmission in the middle then
// differ from those of an endless slab by less than 0.1 % of themselves. (Of photons that walked
// white slabs from the receivers, depths 0.02 to 8 and g from -0.9 to 0.9, at most 0.035 % had ever
// been farther out.)
double default_slab_width(double optical_depth, double anisotropy);

// Writes slab.json, slab.obj and as needed sky.exr and slab.vdb into an existing folder; returns
// the files, scene first. Equal options give equal bytes. Throws Error(InvalidInput) for options
// out of range, Error(Resource) where it cannot write.
std::vector<std::filesystem::path> write_slab(const std::filesystem::path& folder,
                                              const SlabOptions& options);

// A medium of albedo 1 in the box [-1, 1]^3 with a block in it whose walls give off what they do
// not reflect, in an environment of radiance 1 on all sides. Radiance is 1 everywhere and in all
// directions: any picture is white, irradiance is pi, fluence 4 pi.
struct FurnaceOptions {
  double optical_depth = 4;  // Across the box; of lumps, at their mean density.
  double anisotropy = 0;
  double block_albedo = 0.5;
  int resolution = 0;  // 0: an even box. n: a grid of n nodes along each axis, with lumps.
  std::uint64_t seed = 1;
  int threads = 0;
};

// Writes furnace.json, furnace.obj and as needed furnace.vdb; else as write_slab().
std::vector<std::filesystem::path> write_furnace(const std::filesystem::path& folder,
                                                 const FurnaceOptions& options);

}  // namespace brume
