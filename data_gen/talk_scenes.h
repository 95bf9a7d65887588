// The scenes of the talk [JZJ08], from our own numbers: what gradients in media are shown on.
//
// Lengths are metres, y is up. Three of them have a ground plane whose irradiance comes through or
// from the medium; the others are rooms as a user would light them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/math.h"

namespace brume {

// What is left empty is the scene's own choice.
struct TalkSceneOptions {
  int size_px = 512;    // Width of the image.
  int resolution = 64;  // Nodes along the longest side of a medium that is a grid; at least 2.
  double density = 1;   // Multiplies the medium's extinction.
  std::optional<double> albedo;      // sigma_s / sigma_t of the medium.
  std::optional<double> anisotropy;  // Mean cosine of its scattering.
  std::optional<double>
      contrast;               // window, disco: 0 even haze, 1 clear air between clouds of dust.
  std::optional<int> detail;  // window: panes along each side; disco: rings of facets.
  std::uint64_t seed = 5;     // Of the smoke and dust.
  int threads = 0;
};

// absorbing:     a lit panel that the ground sees past a block and through an absorbing cloud.
// scattering:    a lamp with a plate below it: to the ground its light comes scattered or not at
// all. no-walls:      a cloud over open ground, in the sun: nothing that Ward-Heckbert gradients
// could see. smoky-cornell: the demo (smoky_cornell.h). window:        the sun through a window
// into a dusty room. disco:         a ball of mirrors whose beams go through haze.
const std::vector<std::string>& talk_scene_names();

// The part of the ground plane (y = 0) that figures show, for the three scenes that have one.
Box3d talk_ground();

// Writes a scene file and what it needs into an existing folder; returns the files, scene first.
// Equal options give equal bytes. Throws Error(Usage) for an unknown name, Error(InvalidInput) for
// options out of range, Error(Resource) where it cannot write.
std::vector<std::filesystem::path> write_talk_scene(const std::string& name,
                                                    const std::filesystem::path& folder,
                                                    const TalkSceneOptions& options);

}  // namespace brume
