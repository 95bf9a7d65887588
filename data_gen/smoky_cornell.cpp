#include "data_gen/smoky_cornell.h"

#include <cstdio>

#include "core/error.h"
#include "core/staged_file.h"
#include "data_gen/scene_text.h"
#include "vdb_media/grid_writer.h"

namespace brume {

namespace {

const Box3d kRoom({-1, 0, -1}, {1, 2, 1});  // Open at z = 1, where the camera looks in.
const Box3d kTallBlock({-0.65, 0, -0.65}, {-0.05, 1.2, -0.05});
const Box3d kLowBlock({0.05, 0, 0.02}, {0.65, 0.6, 0.62});

struct Paint {
  const char* name;
  Vec3d albedo;
};
constexpr double kWhite = 0.73;
const std::vector<Paint>& paints() {
  static const std::vector<Paint> all{{"white", Vec3d(kWhite)},
                                      {"red", {0.63, 0.065, 0.05}},
                                      {"green", {0.14, 0.45, 0.091}},
                                      {"block", {0.65, 0.63, 0.6}}};
  return all;
}

std::vector<ObjPart> box_parts() {
  const Vec3d x(kRoom.size().x, 0, 0), y(0, kRoom.size().y, 0), z(0, 0, kRoom.size().z);
  std::vector<ObjPart> parts(5);
  parts[0] = {"floor_ceiling_back", "white", {}};
  add_quad(parts[0].mesh, kRoom.min, z, x);      // Floor, faces +y.
  add_quad(parts[0].mesh, kRoom.min + y, x, z);  // Ceiling, faces -y.
  add_quad(parts[0].mesh, kRoom.min, x, y);      // Back, faces +z.
  parts[1] = {"left_wall", "red", {}};
  add_quad(parts[1].mesh, kRoom.min, y, z);  // Faces +x.
  parts[2] = {"right_wall", "green", {}};
  add_quad(parts[2].mesh, kRoom.min + x, z, y);  // Faces -x.
  parts[3] = {"tall_block", "block", {}};
  add_box(parts[3].mesh, kTallBlock, 18);
  parts[4] = {"low_block", "block", {}};
  add_box(parts[4].mesh, kLowBlock, -16);
  return parts;
}

std::string mtl_text() {
  std::string out;
  for (const Paint& paint : paints()) {
    char text[160];
    std::snprintf(text, sizeof text, "newmtl %s\nKd %.9g %.9g %.9g\nillum 1\n", paint.name,
                  paint.albedo.x, paint.albedo.y, paint.albedo.z);
    out += text;
  }
  return out;
}

// From the upper left, outside, into the room and down to its right.
SceneJson flight_cameras(int frames) {
  SceneJson cameras = SceneJson::object();
  for (int i = 0; i < frames; ++i) {
    const double t = frames > 1 ? double(i) / (frames - 1) : 0;
    const Vec3d position(-0.7 * std::cos(kPi * t), 1.25 - 0.5 * t, 3.4 - 1.7 * t);
    const Vec3d look_at(0.15 * std::sin(kPi * t), 0.95 - 0.2 * t, -0.3);
    std::string name = std::to_string(i);
    if (name.size() < 2) name.insert(0, "0");
    cameras["f" + name] = {
        {"position", json_list(position)}, {"look_at", json_list(look_at)}, {"fov_deg", 37}};
  }
  return cameras;
}

SceneJson scene_json(const SmokyCornellOptions& options) {
  SceneJson materials = SceneJson::object(), names = SceneJson::object();
  for (const Paint& paint : paints()) {
    materials[paint.name] = {{"type", "diffuse"}, {"albedo", json_list(paint.albedo)}};
    names[paint.name] = paint.name;
  }
  const SceneJson smoke_albedo =
      options.albedo ? grey(*options.albedo) : SceneJson{0.95, 0.94, 0.92};
  const double haze_s = options.albedo ? 0.13 * *options.albedo : 0.12;
  const double haze_a = options.albedo ? 0.13 * (1 - *options.albedo) : 0.01;
  // From the upper left front corner through the smoke onto the green wall.
  const Vec3d spot(-0.86, 1.82, 0.72), target(0.52, 0.95, 0.22);
  return {{"version", 1},
          {"unit", 1.0},
          {"up", "Y"},
          {"camera",
           {{"position", {0, 1, 3.9}}, {"look_at", {0, 1, 0}}, {"up", {0, 1, 0}}, {"fov_deg", 37}}},
          {"film", {{"resolution", {options.size_px, options.size_px}}}},
          {"meshes", SceneJson::array({{{"file", "box.obj"}, {"materials", names}}})},
          {"materials", materials},
          {"lights", SceneJson::array({{{"type", "quad"},
                                        {"corner", {-0.25, 1.995, -0.25}},
                                        {"edge_u", {0.5, 0, 0}},
                                        {"edge_v", {0, 0, 0.5}},
                                        {"radiance", {11, 9.6, 7.6}}},
                                       {{"type", "spot"},
                                        {"position", json_list(spot)},
                                        {"direction", json_list((target - spot).normalized())},
                                        {"intensity", {13, 14.5, 17}},
                                        {"inner_deg", 6.5},
                                        {"outer_deg", 8}}})},
          {"volumes", SceneJson::array({{{"type", "vdb"},
                                         {"file", "smoke.vdb"},
                                         {"grids", {{"density", "density"}}},
                                         {"density_scale", 9 * options.density},
                                         {"albedo", smoke_albedo},
                                         {"anisotropy", options.anisotropy.value_or(0.3)}},
                                        {{"type", "homogeneous"},
                                         {"bounds", json_list(kRoom)},
                                         {"sigma_s", grey(haze_s * options.density)},
                                         {"sigma_a", grey(haze_a * options.density)},
                                         {"anisotropy", options.anisotropy.value_or(0.4)}}})},
          {"render", {{"bounces", 3}, {"volume_bounces", "auto"}, {"seed", 1}, {"cells", {16, 50}}}}};
}

}  // namespace

SmokePlume smoky_cornell_plume(std::uint64_t seed) {
  SmokePlume plume;
  plume.source = {kLowBlock.center().x, kLowBlock.max.y + 0.005, kLowBlock.center().z};
  plume.height = kRoom.max.y - plume.source.y;
  plume.source_radius = 0.14;
  plume.top_radius = 0.72;
  plume.curl = 0.5;
  plume.detail = 1.1;
  plume.fade_box = kRoom;
  plume.fade_width = 0.06;
  plume.seed = seed;
  return plume;
}

std::vector<std::filesystem::path> write_smoky_cornell(const std::filesystem::path& folder,
                                                       const SmokyCornellOptions& options) {
  const auto check = [](bool good, const char* message) {
    if (!good) throw Error(ErrorKind::InvalidInput, message);
  };
  check(options.resolution >= 2 && options.resolution <= 1024,
        "smoky-cornell: resolution: outside 2 to 1024: choose a number within");
  check(options.size_px >= 1 && options.size_px <= 16384,
        "smoky-cornell: size: outside 1 to 16384 pixels: choose a number within");
  check(options.flight_frames >= 0 && options.flight_frames <= 1000,
        "smoky-cornell: flight: outside 0 to 1000 cameras: choose a number within");

  const Lattice lattice = covering_lattice(kRoom, kRoom.size().x / (options.resolution - 1));
  const std::vector<std::filesystem::path> files{folder / "smoky_cornell.json", folder / "box.obj",
                                                 folder / "box.mtl", folder / "smoke.vdb"};
  write_grids(files[3],
              {{.name = "density",
                .count = lattice.count,
                .values = sample_field(smoky_cornell_plume(options.seed), lattice, options.threads),
                .index_to_world = lattice.index_to_world()}});
  write_file_whole(files[2], mtl_text());
  write_file_whole(files[1], obj_text(box_parts(), "box.mtl"));
  // Last: a scene that is there has its files.
  SceneJson scene = scene_json(options);
  if (options.flight_frames > 0) scene["cameras"] = flight_cameras(options.flight_frames);
  write_file_whole(files[0], scene_text(scene));
  return files;
}

}  // namespace brume
