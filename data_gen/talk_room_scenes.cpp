// The rooms of the talk: the sun through a window, and a disco ball.
#include "data_gen/talk_scene_parts.h"

namespace brume {

namespace {

constexpr double kTurn = kPi / 180;  // Radians a degree.

// Dust that fills a room, or an even haze where there is no contrast.
AnalyticField room_haze(const Box3d& room, double contrast, std::uint64_t seed) {
  if (contrast == 0) return ConstantBox{room, 1};
  Dust dust;
  dust.density = 1;
  dust.scale_height = 4;
  dust.feature_size = 0.9;
  dust.contrast = contrast;
  dust.seed = seed;
  return dust;
}

// Floor, ceiling and the walls of a box, seen from inside; walls by the axis and side asked for.
void add_floor(TriangleMesh& mesh, const Box3d& room) {
  add_quad(mesh, room.min, {0, 0, room.size().z}, {room.size().x, 0, 0});
}
void add_ceiling(TriangleMesh& mesh, const Box3d& room) {
  add_quad(mesh, {room.min.x, room.max.y, room.min.z}, {room.size().x, 0, 0},
           {0, 0, room.size().z});
}
void add_wall_x(TriangleMesh& mesh, const Box3d& room, bool at_max) {
  const Vec3d up(0, room.size().y, 0), along(0, 0, room.size().z);
  add_quad(mesh, {at_max ? room.max.x : room.min.x, room.min.y, room.min.z}, at_max ? along : up,
           at_max ? up : along);
}
void add_wall_z(TriangleMesh& mesh, const Box3d& room, bool at_max) {
  const Vec3d up(0, room.size().y, 0), along(room.size().x, 0, 0);
  add_quad(mesh, {room.min.x, room.min.y, at_max ? room.max.z : room.min.z}, at_max ? up : along,
           at_max ? along : up);
}

// A wall of the thickness of `wall` with an opening, and the bars that part it into panes.
void add_window_wall(TriangleMesh& mesh, TriangleMesh& bars, const Box3d& wall,
                     const Box3d& opening, int panes) {
  const Vec3d &a = wall.min, &b = wall.max, &c = opening.min, &d = opening.max;
  add_box(mesh, {a, {b.x, c.y, b.z}});                // Below.
  add_box(mesh, {{a.x, d.y, a.z}, b});                // Above.
  add_box(mesh, {{a.x, c.y, a.z}, {b.x, d.y, c.z}});  // Beside.
  add_box(mesh, {{a.x, c.y, d.z}, {b.x, d.y, b.z}});
  constexpr double kBar = 0.05;
  const double x = wall.center().x;
  for (int i = 0; i <= panes; ++i) {
    const double y = c.y + (d.y - c.y) * i / panes, z = c.z + (d.z - c.z) * i / panes;
    add_box(bars, {{x - kBar / 2, y - kBar / 2, c.z}, {x + kBar / 2, y + kBar / 2, d.z}});
    add_box(bars, {{x - kBar / 2, c.y, z - kBar / 2}, {x + kBar / 2, d.y, z + kBar / 2}});
  }
}

// A ball of flat facets in rings, each with the beam that it throws outwards.
struct Facet {
  Vec3d outwards{0.0};  // Unit.
  int ring = 0, place = 0;
};
std::vector<Facet> beam_facets(int rings) {
  // From steeply down to slightly up, where walls and floor are.
  constexpr double kLowest = -64, kHighest = 20;
  std::vector<Facet> all;
  for (int ring = 0; ring < rings; ++ring) {
    const double latitude =
        kTurn * (rings == 1 ? -20.0 : kLowest + (kHighest - kLowest) * ring / (rings - 1));
    const int count = std::max(3, static_cast<int>(std::lround(2.6 * rings * std::cos(latitude))));
    for (int i = 0; i < count; ++i) {
      const double longitude = 2 * kPi * (i + 0.37 * ring) / count;
      all.push_back({{std::cos(latitude) * std::cos(longitude), std::sin(latitude),
                      std::cos(latitude) * std::sin(longitude)},
                     ring,
                     i});
    }
  }
  return all;
}

void add_faceted_ball(TriangleMesh& mesh, const Vec3d& centre, double radius, int around) {
  const int rings = around / 2;
  const auto at = [&](int ring, int i) {
    const double latitude = kPi * (double(ring) / rings - 0.5), longitude = 2 * kPi * i / around;
    return centre + Vec3d(std::cos(latitude) * std::cos(longitude), std::sin(latitude),
                          std::cos(latitude) * std::sin(longitude)) *
                        radius;
  };
  for (int ring = 0; ring < rings; ++ring)
    for (int i = 0; i < around; ++i) {
      // Corners of its own for each facet: flat mirrors, not a smooth ball.
      const auto first = static_cast<std::uint32_t>(mesh.positions.size());
      mesh.positions.insert(mesh.positions.end(),
                            {at(ring, i), at(ring + 1, i), at(ring + 1, i + 1), at(ring, i + 1)});
      if (ring + 1 < rings) mesh.triangles.push_back({first, first + 1, first + 2});
      if (ring > 0) mesh.triangles.push_back({first, first + 2, first + 3});
    }
}

}  // namespace

TalkScene window_scene(const TalkSceneOptions& options) {
  const Box3d room({-2, 0, -2.5}, {2, 2.6, 2.5});
  const Box3d opening({2, 0.75, -1.7}, {2.15, 2.25, 0.5});
  TalkScene scene{.camera = camera_json({-1.55, 1.45, 2.35}, {0.5, 1.0, -0.9}, 55),
                  .aspect = 16.0 / 10,
                  .medium = {},
                  .bounces = 3};
  TalkMesh plaster{"plaster", diffuse({0.72, 0.68, 0.6})};
  add_ceiling(plaster.mesh, room);
  add_wall_x(plaster.mesh, room, false);
  add_wall_z(plaster.mesh, room, false);
  add_wall_z(plaster.mesh, room, true);
  TalkMesh frame{"frame", diffuse({0.4, 0.36, 0.32})};
  // Beyond the room's corners, so that no sun comes in between two walls.
  add_window_wall(plaster.mesh, frame.mesh, {{2, -0.1, -2.7}, {2.15, 2.7, 2.7}}, opening,
                  options.detail.value_or(3));
  TalkMesh floor{"floor", diffuse({0.42, 0.27, 0.16})};
  add_floor(floor.mesh, room);
  TalkMesh furniture{"furniture", diffuse({0.3, 0.38, 0.42})};
  add_box(furniture.mesh, {{-0.35, 0, -1.9}, {0.55, 0.5, -1.25}}, 12);
  add_box(furniture.mesh, {{-1.95, 0, -2.45}, {-1.3, 1.5, -1.7}}, 0);
  // A bright sky behind the window, which only eyes and gathers see: it lights the room softly and
  // does not shade the sun.
  TalkMesh sky{"sky", diffuse(Vec3d(0.0)), {}, false};
  sky.material["emission"] = {1.1, 1.5, 2.1};
  sky.material["direct"] = false;
  add_quad(sky.mesh, {3.4, -0.5, -4}, {0, 0, 7}, {0, 5, 0});  // Faces -x.
  scene.meshes = {plaster, floor, frame, furniture, sky};
  scene.lights.push_back({{"type", "directional"},
                          {"direction", json_list(Vec3d(-0.74, -0.6, 0.16).normalized())},
                          {"irradiance", {42, 37, 29}}});
  scene.medium = {room_haze(room, options.contrast.value_or(0.6), options.seed), room, 0.22, 0.95,
                  0.4};
  return scene;
}

TalkScene disco_scene(const TalkSceneOptions& options) {
  const Box3d room({-3, 0, -3}, {3, 3.2, 3});
  const Vec3d centre(0, 2.35, 0);
  constexpr double kRadius = 0.32;
  TalkScene scene{.camera = camera_json({-0.6, 1.35, 2.9}, {0.1, 1.5, -1.2}, 62),
                  .aspect = 16.0 / 10,
                  .medium = {},
                  .bounces = 2};
  TalkMesh walls{"walls", diffuse(Vec3d(0.62))};
  add_ceiling(walls.mesh, room);
  for (const bool at_max : {false, true}) {
    add_wall_x(walls.mesh, room, at_max);
    add_wall_z(walls.mesh, room, at_max);
  }
  TalkMesh floor{"floor", diffuse({0.35, 0.33, 0.36})};
  add_floor(floor.mesh, room);
  TalkMesh stage{"stage", diffuse({0.5, 0.46, 0.5})};
  add_box(stage.mesh, {{-2.9, 0, -2.7}, {-1.5, 1.05, -1.9}}, 0);
  add_box(stage.mesh, {{1.1, 0, -1.6}, {1.7, 1.5, -1.0}}, 25);
  add_box(stage.mesh, {{0.1, 0, -2.6}, {0.7, 0.6, -2.0}}, -18);
  TalkMesh ball{
      "ball",
      {{"type", "glossy"}, {"albedo", grey(0.08)}, {"specular", grey(0.8)}, {"roughness", 0.2}}};
  add_faceted_ball(ball.mesh, centre, kRadius, 28);
  scene.meshes = {walls, floor, stage, ball};

  const std::vector<Vec3d> gels{
      {1, 0.86, 0.6}, {1, 0.18, 0.45}, {0.2, 0.6, 1}, {0.95, 0.55, 0.1}, {0.25, 1, 0.45}};
  for (const Facet& f : beam_facets(options.detail.value_or(5))) {
    const Vec3d colour = gels[static_cast<std::size_t>(f.place * 2 + f.ring) % gels.size()];
    // Mirrors are flat: a beam begins in front of its facet, so the ball does not shade it.
    scene.lights.push_back({{"type", "spot"},
                            {"position", json_list(centre + f.outwards * (kRadius + 0.01))},
                            {"direction", json_list(f.outwards)},
                            {"intensity", json_list(colour * 60.0)},
                            {"inner_deg", 2.2},
                            {"outer_deg", 3.2}});
  }
  // What the mirrors reflect: a lamp from a corner onto the ball.
  const Vec3d lamp(2.7, 3.0, 2.4);
  scene.lights.push_back({{"type", "spot"},
                          {"position", json_list(lamp)},
                          {"direction", json_list((centre - lamp).normalized())},
                          {"intensity", {60, 58, 55}},
                          {"inner_deg", 4.6},
                          {"outer_deg", 5.4}});
  scene.medium = {room_haze(room, options.contrast.value_or(0), options.seed), room, 0.16, 0.95,
                  0.3};
  return scene;
}

}  // namespace brume
