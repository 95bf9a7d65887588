// Scenes whose records must follow what is near: ground that goes far, and rooms side by side.
#pragma once

#include "support/smoky_rooms.h"

namespace brume::test {

inline BakeSettings far_settings(int bounces) {
  BakeSettings s = coarse_settings(bounces);
  s.gather.cells_theta = 10;
  s.gather.cells_phi = 32;
  s.max_radius = kInfinity;
  return s;
}

// A red block and a wall on ground that goes `half` far, under a lamp.
inline Scene block_on_ground(double half) {
  Scene scene;
  const auto grey = add_material(scene, diffuse(0.6f));
  const auto red = add_material(scene, [] {
    Material m;
    m.albedo = Rgb(0.8f, 0.3f, 0.2f);
    return m;
  }());
  add_rectangle(scene, {-half, -half, 0}, {2 * half, 0, 0}, {0, 2 * half, 0}, grey);
  add_rectangle(scene, {-0.6, -0.5, 0}, {0, 0, 0.8}, {0, 1.2, 0}, red);
  add_rectangle(scene, {-0.2, -0.2, 0}, {0.4, 0, 0}, {0, 0, 0.3}, red);
  add_rectangle(scene, {0.2, -0.2, 0}, {0, 0.4, 0}, {0, 0, 0.3}, red);
  add_rectangle(scene, {-0.2, 0.2, 0}, {0, -0.4, 0}, {0, 0, 0.3}, red);
  scene.lights.emplace_back(PointLight{{0.9, -0.6, 1.4}, Rgb(3.0f)});
  return scene;
}

inline BakeView view_of_block() {
  BakeView view{"block", {}, 48, 36};
  view.camera = {{1.4, -1.3, 0.9}, {-0.1, 0, 0.15}, {0, 0, 1}, 40};
  return view;
}

// Rooms side by side along x, a lamp in the left one, a wall of so much thickness between.
inline Scene two_rooms(double thickness) {
  Scene scene;
  const auto white = add_material(scene, diffuse(0.8f));
  add_room(scene, Box3d({-2, -1, 0}, {0, 1, 2}), white);
  add_room(scene, Box3d({thickness, -1, 0}, {2 + thickness, 1, 2}), white);
  scene.lights.emplace_back(PointLight{{-0.6, 0, 1}, Rgb(5.0f)});
  return scene;
}

// From x, towards another.
inline BakeView view_along(double x, double to) {
  BakeView view{"room", {}, 32, 24};
  view.camera = {{x, 0.3, 1.2}, {to, -0.4, 0.6}, {0, 0, 1}, 80};
  return view;
}

}  // namespace brume::test
