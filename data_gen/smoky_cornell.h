// The demo: a Cornell box with smoke rising from the low block, thin haze, a ceiling lamp and a
// spot whose beam goes through the smoke.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "data_gen/analytic_field.h"

namespace brume {

struct SmokyCornellOptions {
  int resolution = 128;  // Nodes of the smoke along each axis; at least 2.
  int size_px = 512;     // Width and height of the image.
  // Named cameras f00, f01 ... of a flight into the room, besides the one that is there; at most
  // 1000.
  int flight_frames = 0;
  double density = 1;    // Multiplies the extinction of smoke and haze.
  // Of the smoke and the haze; empty: the demo's own.
  std::optional<double> albedo, anisotropy;
  std::uint64_t seed = 5;
  int threads = 0;
};

// The smoke as a field; in metres, like the scene.
SmokePlume smoky_cornell_plume(std::uint64_t seed);

// Writes smoky_cornell.json, box.obj, box.mtl and smoke.vdb into an existing folder; returns the
// files, scene first. Equal options give equal bytes. Throws Error(InvalidInput) for options out of
// range, Error(Resource) where it cannot write.
std::vector<std::filesystem::path> write_smoky_cornell(const std::filesystem::path& folder,
                                                       const SmokyCornellOptions& options);

}  // namespace brume
