// How much light flickers on surfaces from one frame of a moving camera to the next, and how much
// of that is error (docs/flicker.md).
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/math.h"

namespace brume {

// One rendered frame; all vectors row by row, top first.
struct FlickerFrame {
  int width = 0, height = 0;
  std::array<float, 16> world_to_camera{};  // Row-major, column vectors; the camera looks along -z.
  double fov_deg = 0;                       // Vertical.
  std::vector<Rgb> light;                   // The layer that is judged.
  std::vector<Vec3f> position, normal;      // Of the surface that is seen, world space.
  std::vector<float> depth;                 // Along the view axis.
  std::vector<float> alpha;                 // 1: every sample of the pixel hit a surface.
};

struct FlickerOptions {
  int block =
      8;  // Pixels a side of what is averaged, as eyes do: single pixels hold sampling noise.
};

// All relative to the mean of what is judged against: the reference, or else the frames themselves.
struct Flicker {
  double matched = 0;  // Part of the pixels whose surface point the next frame sees too.
  double change =
      0;  // Root mean square, over blocks, of how much light changes at the same points.
  // With a reference: its own change, and the change of (frame - reference), which is flicker. A
  // reference's noise counts in both, unless there are two that are independent: then the squares
  // are products of the two, whose noise has the mean 0, and may come out below 0; so does their
  // root here, with its sign.
  double reference_change = 0, error_change = 0;
};

// A frame and its references: none, one, or two that share no random numbers.
struct FlickerView {
  FlickerFrame frame;
  std::vector<FlickerFrame> references;
};

double signed_root(double square);

// From frame a to frame b. Points are those of a's pixels that b sees as well: the four pixels of b
// around the projection are the same surface, within two pixels' width and 18 degrees of its
// normal. References must be of the same cameras. Throws Error(InvalidInput) where sizes differ.
Flicker frame_flicker(const FlickerView& a, const FlickerView& b, const FlickerOptions& options);

}  // namespace brume
