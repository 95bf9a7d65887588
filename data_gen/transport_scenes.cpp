#include "data_gen/transport_scenes.h"

#include "core/error.h"
#include "core/image.h"
#include "core/staged_file.h"
#include "data_gen/analytic_field.h"
#include "data_gen/scene_text.h"
#include "vdb_media/grid_writer.h"

namespace brume {

namespace {

namespace fs = std::filesystem;

// A receiver's distance to the slab, and half its side. What is missing beyond the slab's edges is
// of the order of (2 gap / width)^2, what a receiver keeps from the slab of (side / gap)^2.
constexpr double kGap = 0.05, kHalfSide = kGap / 100;

constexpr const char* kSlabNotes =
    R"(// A slab of thickness 1 lit from above: which part of the light it reflects (R) and lets
// through (T). One pixel of many samples prints R as `beauty`:
//
//   brume render slab.json --camera reflection --integrator path --transport full
//       --res 1x1 --spp 262144 --pixel 0,0 --json
//
// With `--camera transmission` it is T, whose unscattered part is `diffuse_direct`. Larger pictures
// are even; their mean is the answer. The cached integrator, whose light scatters once in the
// medium, tells less of it.
//
)";
constexpr const char* kNormalNotes =
    R"(// The light is a beam along -y of irradiance pi.
)";
constexpr const char* kDiffuseNotes =
    R"(// The light is a sky of radiance 1 above the horizon, black below it. The cameras `above` and
// `below` look into the slab along its normal: by reciprocity they see R and T of a beam along it.
)";
constexpr const char* kFurnaceNotes =
    R"(// Radiance is 1 everywhere and in all directions: every picture of every camera is white,
//
//   brume render furnace.json -o furnace.exr --integrator path --transport full
)";

void require(bool good, const std::string& message) {
  if (!good) throw Error(ErrorKind::InvalidInput, message);
}

void check_medium(const std::string& scene, double optical_depth, double anisotropy,
                  int resolution) {
  require(optical_depth > 0 && optical_depth <= 1e4,
          scene + ": optical depth: outside (0, 1e4]: choose a number within");
  require(anisotropy > -1 && anisotropy < 1,
          scene + ": anisotropy: outside (-1, 1): choose a number within");
  require(resolution == 0 || (resolution >= 2 && resolution <= 1024),
          scene + ": resolution: neither 0 nor 2 to 1024: choose such a number");
}

// The rows above the horizon are white. Between pixel centres radiance is interpolated, so the
// horizon is blurred over pi / kRows; the flux through a level plane changes by (pi / kRows)^2 / 24
// of itself.
void write_sky(const fs::path& file) {
  constexpr int kColumns = 2, kRows = 512;
  Image sky;
  sky.width = kColumns;
  sky.height = kRows;
  std::vector<float> values(kColumns * kRows, 0.0f);
  std::fill(values.begin(), values.begin() + kColumns * kRows / 2, 1.0f);
  for (const char* name : {"R", "G", "B"}) sky.channels.push_back({name, true, values});
  write_exr(file, sky, {});
}

// Faces the slab, whose side of it is `facing`, +1 or -1 along y.
TriangleMesh receiver(double y, double facing) {
  const Vec3d u(2 * kHalfSide, 0, 0), v(0, 0, 2 * kHalfSide);
  const Vec3d corner(-kHalfSide, y, -kHalfSide);
  TriangleMesh mesh;
  if (facing > 0)
    add_quad(mesh, corner, v, u);
  else
    add_quad(mesh, corner, u, v);
  return mesh;
}

SceneJson camera(const Vec3d& position, const Vec3d& look_at, const Vec3d& up, double fov_deg) {
  return {{"position", json_list(position)},
          {"look_at", json_list(look_at)},
          {"up", json_list(up)},
          {"fov_deg", fov_deg}};
}

SceneJson slab_cameras() {
  // In the gap, at 45 degrees; the picture is well within the receiver.
  constexpr double kFov = 0.4;
  const double off = kGap / 2;
  // Beside the receivers.
  constexpr double kAside = 0.25;
  return {{"reflection", camera({0, 1 + kGap - off, off}, {0, 1 + kGap, 0}, {0, 1, 0}, kFov)},
          {"transmission", camera({0, off - kGap, off}, {0, -kGap, 0}, {0, 1, 0}, kFov)},
          {"above", camera({kAside, 2, 0}, {kAside, 0.5, 0}, {1, 0, 0}, kFov)},
          {"below", camera({kAside, -1, 0}, {kAside, 0.5, 0}, {1, 0, 0}, kFov)}};
}

SceneJson slab_volume(const SlabOptions& options, double width, const fs::path& vdb) {
  if (options.resolution == 0)
    return {{"type", "homogeneous"},
            {"bounds", json_list(Box3d({-width / 2, 0, -width / 2}, {width / 2, 1, width / 2}))},
            {"sigma_s", grey(options.optical_depth * options.albedo)},
            {"sigma_a", grey(options.optical_depth * (1 - options.albedo))},
            {"anisotropy", options.anisotropy}};
  // Along y nodes stand one voxel inside the faces, where the interpolated density reaches 0. To
  // the sides they reach the width, and the descent lies outside.
  const int n = options.resolution;
  const Vec3d voxel(width / (n - 1), 1.0 / (n + 1), width / (n - 1));
  const Vec3d first(-width / 2, voxel.y, -width / 2);
  Affine3d index_to_world;
  for (int a = 0; a < 3; ++a) {
    index_to_world.m[a][a] = voxel[a];
    index_to_world.m[a][3] = first[a];
  }
  write_grids(vdb, {{.name = "density",
                     .count = Vec3i(n),
                     .values = std::vector<float>(std::size_t(n) * n * n, 1.0f),
                     .index_to_world = index_to_world}});
  return {{"type", "vdb"},
          {"file", vdb.filename().string()},
          {"grids", {{"density", "density"}}},
          // The two outermost voxels hold half of what the others do.
          {"density_scale", options.optical_depth * (n + 1) / n},
          {"albedo", grey(options.albedo)},
          {"anisotropy", options.anisotropy}};
}

}  // namespace

double default_slab_width(double optical_depth, double anisotropy) {
  return std::max(20.0, 12 / (optical_depth * std::min(1.0, 1 - anisotropy)));
}

std::vector<fs::path> write_slab(const fs::path& folder, const SlabOptions& options) {
  check_medium("slab", options.optical_depth, options.anisotropy, options.resolution);
  require(options.albedo >= 0 && options.albedo <= 1,
          "slab: albedo: outside 0 to 1: choose a number within");
  require(!options.width || (*options.width >= 1 && *options.width <= 1e6),
          "slab: width: outside 1 to 1e6: choose a number within");
  const double width =
      options.width.value_or(default_slab_width(options.optical_depth, options.anisotropy));
  const bool is_diffuse = options.incidence == SlabOptions::Incidence::Diffuse;

  std::vector<fs::path> files{folder / "slab.json", folder / "slab.obj"};
  write_file_whole(files[1], obj_text({{"receiver_above", "white", receiver(1 + kGap, -1)},
                                       {"receiver_below", "white", receiver(-kGap, 1)}},
                                      ""));
  SceneJson light{{"type", "directional"}, {"direction", {0, -1, 0}}, {"irradiance", grey(kPi)}};
  if (is_diffuse) {
    files.push_back(folder / "sky.exr");
    write_sky(files.back());
    light = {{"type", "environment"}, {"file", "sky.exr"}};
  }
  const fs::path vdb = folder / "slab.vdb";
  if (options.resolution > 0) files.push_back(vdb);
  const SceneJson scene{
      {"version", 1},
      {"unit", 1.0},
      {"up", "Y"},
      {"cameras", slab_cameras()},
      {"film", {{"resolution", {32, 32}}}},
      // Without shadows the upper one keeps nothing of the beam from the slab.
      {"meshes",
       SceneJson::array({{{"file", "slab.obj"}, {"material", "white"}, {"casts_shadow", false}}})},
      {"materials", {{"white", {{"type", "diffuse"}, {"albedo", grey(1)}}}}},
      {"lights", SceneJson::array({light})},
      {"volumes", SceneJson::array({slab_volume(options, width, vdb)})},
      {"render", {{"bounces", 1}, {"volume_bounces", "auto"}, {"seed", 1}}}};
  write_file_whole(
      files.front(),
      kSlabNotes + std::string(is_diffuse ? kDiffuseNotes : kNormalNotes) + scene_text(scene));
  return files;
}

std::vector<fs::path> write_furnace(const fs::path& folder, const FurnaceOptions& options) {
  check_medium("furnace", options.optical_depth, options.anisotropy, options.resolution);
  require(options.block_albedo >= 0 && options.block_albedo <= 1,
          "furnace: block albedo: outside 0 to 1: choose a number within");
  const Box3d box({-1, -1, -1}, {1, 1, 1});
  const double sigma_s = options.optical_depth / box.size().x;

  std::vector<fs::path> files{folder / "furnace.json", folder / "furnace.obj"};
  TriangleMesh block;
  add_box(block, {{-0.3, -0.55, -0.3}, {0.3, -0.05, 0.3}}, 18);
  write_file_whole(files[1], obj_text({{"block", "block", block}}, ""));
  SceneJson volume{{"type", "homogeneous"},
                   {"bounds", json_list(box)},
                   {"sigma_s", grey(sigma_s)},
                   {"sigma_a", grey(0)}};
  if (options.resolution > 0) {
    files.push_back(folder / "furnace.vdb");
    // So high that its mean is the same everywhere.
    const Dust lumps{.density = 1,
                     .scale_height = 1e9,
                     .ground = 0,
                     .feature_size = 0.8,
                     .contrast = 0.9,
                     .seed = options.seed};
    const Lattice lattice = covering_lattice(box, box.size().x / (options.resolution - 1));
    write_grids(files.back(), {{.name = "density",
                                .count = lattice.count,
                                .values = sample_field(lumps, lattice, options.threads),
                                .index_to_world = lattice.index_to_world()}});
    volume = {{"type", "vdb"},
              {"file", "furnace.vdb"},
              {"grids", {{"density", "density"}}},
              {"density_scale", sigma_s},
              {"albedo", grey(1)}};
  }
  volume["anisotropy"] = options.anisotropy;
  SceneJson material{{"type", "diffuse"}, {"albedo", grey(options.block_albedo)}};
  if (options.block_albedo < 1) {
    material["emission"] = grey(1 - options.block_albedo);
    material["direct"] = false;
  }
  const SceneJson scene{
      {"version", 1},
      {"unit", 1.0},
      {"up", "Y"},
      {"camera", camera({2.2, 1.6, 3}, {0, 0, 0}, {0, 1, 0}, 40)},
      {"cameras", {{"inside", camera({0.6, 0.5, 0.7}, {0, -0.3, 0}, {0, 1, 0}, 60)}}},
      {"film", {{"resolution", {64, 64}}}},
      {"meshes", SceneJson::array({{{"file", "furnace.obj"}, {"material", "block"}}})},
      {"materials", {{"block", material}}},
      {"lights", SceneJson::array({{{"type", "environment"}, {"radiance", grey(1)}}})},
      {"volumes", SceneJson::array({volume})},
      {"render", {{"bounces", 4}, {"volume_bounces", "auto"}, {"seed", 1}}}};
  write_file_whole(files.front(), kFurnaceNotes + scene_text(scene));
  return files;
}

}  // namespace brume
