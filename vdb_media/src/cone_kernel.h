// A packet of rays through the shells of one gather: what ConeMarcher computes in vectors, a ray a
// lane. One source for every instruction set, chosen when the program runs; arithmetic is done lane
// by lane without fused operations or libm, so that all give the same bits.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace brume {

inline constexpr int kConeLanes = 16;
using ConeLane = std::array<float, kConeLanes>;

// One level of a pyramid, as seen from the rays' origin.
struct ConeLevel {
  const float* nodes = nullptr;
  const std::int32_t* top = nullptr;
  const float* tiles = nullptr;
  std::array<float, 3> origin{};  // Of the rays, from the first brick's first node [voxels].
  std::array<std::int32_t, 3> bricks{};
  float scale = 1;  // Voxels of the finest level over this one's.
};

struct ConeStep {
  float begin = 0, end = 0;
  std::int32_t level = 0;
  float shift = 0;  // Of its sample, by rays.
};

// One volume's shells. Homogeneous ones have no levels, and a step a shell.
struct ConeTrack {
  std::vector<ConeLevel> levels;
  std::vector<ConeStep> steps;
  std::vector<std::int32_t> shell_ends;  // Of each shell's steps.
  std::vector<float> shifts;             // Of what chooses between a shell's steps.
  float mean_sigma_t = 0;
  float enough = 0;  // Density integral behind which nothing is seen.
};

struct ConePacket {
  alignas(64) std::array<ConeLane, 3> direction;  // In the finest level's voxels.
  alignas(64) ConeLane begin, end;                // Where the volume can be.
  alignas(64) ConeLane place, choice;             // Of the ray among others, in [0, 1).
};

// By shell, then lane; running integrals have one more shell.
struct ConeDensity {
  float *integral, *sample;
  std::array<float*, 3> gradient, moment;  // Null where they are not wanted.
};

void march_cones(const ConeTrack& track, const ConePacket& packet, const ConeDensity& density);

// What is left of light from each shell on its way to the origin, averaged over the shell as if its
// density were even, and from the end. `depths` are optical depths by shell, then lane.
void dim_cones(int shells, const float* depths, float* of_shell, float* of_end);

}  // namespace brume
