// A packet of rays through common shells: what ConeMarcher and DepthMarcher compute in vectors, a
// ray a lane. One source for every instruction set, chosen when the program runs; arithmetic is
// done lane by lane without fused operations or libm, so that all give the same bits.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "vdb_media/brick_pyramid.h"

namespace brume {

inline constexpr int kConeLanes = 16;
using ConeLane = std::array<float, kConeLanes>;

// One level of a pyramid.
struct ConeLevel {
  const float* nodes = nullptr;
  const std::int32_t* top = nullptr;
  const float* tiles = nullptr;
  std::array<std::int32_t, 3> bricks{};
  // From the finest level's voxels, counted from its first brick, to this one's.
  float scale = 1;
  std::array<float, 3> offset{};
};
ConeLevel cone_level(const BrickPyramid& pyramid, int level);
// Whether vectors of 32-bit numbers can count a grid's nodes and the positions of its bricks: not those
// of grids above 8 GiB.
bool is_countable(std::int64_t bricks, std::int64_t positions);
// As BrickPyramid::level_for(), but no finer than the finest level that is countable.
int cone_level_for(const BrickPyramid& pyramid, double width);

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
  float enough = 0;     // Density integral behind which nothing is seen.
  bool samples = true;  // Whether a step is chosen to stand for its shell.
};

struct ConePacket {
  // In the finest level's voxels, from its first brick.
  alignas(64) std::array<ConeLane, 3> origin, direction;
  alignas(64) ConeLane begin, end;     // Where the volume can be.
  alignas(64) ConeLane place, choice;  // Of the ray among others, in [0, 1).
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
