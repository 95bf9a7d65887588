#include "data_gen/oracle_scenes.h"

#include "core/error.h"
#include "core/staged_file.h"
#include "data_gen/scene_text.h"
#include "vdb_media/grid_writer.h"

namespace brume {

namespace {

const OracleEmitter kCeilingPatch{{-0.5, -0.4, 1}, {0, 0.9, 0}, {1.1, 0, 0}, 4};
const OracleEmitter kPolygon{{1.2, -0.8, 0.2}, {0, 0, 1.3}, {0, 1.6, 0}, 4};
const Box3d kBlock({0.3, -0.2, 0.0}, {0.6, 0.3, 0.5});
const Box3d kPlate({-0.5, -0.5, 1.5}, {0.5, 0.5, 1.55});
const Box3d kCard({-0.5, -0.5, 2.6}, {0.5, 0.5, 2.65});
const PointLight kLampInside{{0.1, 0.05, 1.9}, Rgb(10.0f)};
const PointLight kLampOutside{{0.1, 0.05, 3.5}, Rgb(10.0f)};

OracleMedium absorbing(const GaussianSum& sigma_t) { return {.sigma_t = sigma_t}; }
OracleMedium emitting(const GaussianSum& sigma_t) { return {.sigma_t = sigma_t, .emission = 1}; }
OracleMedium scattering(const GaussianSum& sigma_t, double anisotropy = 0) {
  return {.sigma_t = sigma_t, .albedo = 0.8, .anisotropy = anisotropy};
}
GaussianSum even(double sigma_t) { return {sigma_t, {}}; }
OracleMedium on_grid(OracleMedium medium, double step) {
  medium.grid_step = step;
  medium.is_grid_fixed = true;
  return medium;
}

// Walls and ceiling with their fronts inwards.
TriangleMesh room_mesh() {
  const Box3d r = oracle_room();
  const Vec3d x(r.size().x, 0, 0), y(0, r.size().y, 0), z(0, 0, r.size().z);
  TriangleMesh mesh;
  mesh.name = "room";
  mesh.casts_shadow = false;
  add_quad(mesh, r.min, y, z);    // Faces +x.
  add_quad(mesh, r.max, -z, -y);  // Faces -x.
  add_quad(mesh, r.min, z, x);    // Faces +y.
  add_quad(mesh, r.max, -x, -z);  // Faces -y.
  add_quad(mesh, r.max, -y, -x);  // Faces -z.
  return mesh;
}

struct OracleMesh {
  TriangleMesh mesh;
  Material material;
};

// One mesh a material, so that each can be a file of its own with its own shadow flag.
std::vector<OracleMesh> meshes_of(const OracleScene& oracle) {
  std::vector<OracleMesh> meshes;
  Material black;
  black.name = "black";
  black.albedo = Rgb(0.0f);
  if (oracle.has_room) meshes.push_back({room_mesh(), black});
  if (!oracle.blocks.empty()) {
    TriangleMesh blocks;
    blocks.name = "blocks";
    for (const Box3d& box : oracle.blocks) add_box(blocks, box);
    meshes.push_back({blocks, black});
  }
  for (std::size_t i = 0; i < oracle.emitters.size(); ++i) {
    const OracleEmitter& e = oracle.emitters[i];
    TriangleMesh quad;
    quad.name = i == 0 ? "emitter" : "emitter" + std::to_string(i);
    add_quad(quad, e.corner, e.edge_u, e.edge_v);
    Material glow = black;
    glow.name = "glow_" + quad.name;
    glow.emission = Rgb(float(e.radiance));
    glow.emission_lobe = e.lobe;
    glow.direct = false;  // Indirect irradiance then is all that arrives from it.
    meshes.push_back({quad, glow});
  }
  return meshes;
}

Lattice medium_lattice(const OracleMedium& medium) {
  return covering_lattice(oracle_room(), medium.grid_step);
}

}  // namespace

Box3d oracle_room() { return {{-2, -2, 0}, {2, 2, 2.5}}; }

std::vector<OracleScene> oracle_scenes(double grid_step) {
  std::vector<OracleScene> scenes{
      {.name = "vac", .emitters = {kCeilingPatch}},
      {.name = "vacblk", .emitters = {kPolygon}, .blocks = {kBlock}, .has_room = true},
      {.name = "abs",
       .emitters = {kPolygon},
       .blocks = {kBlock},
       .has_room = true,
       .medium = absorbing(even(0.8))},
      {.name = "absg",
       .emitters = {kPolygon},
       .blocks = {kBlock},
       .has_room = true,
       .medium = absorbing(three_gaussians(0.1))},
      {.name = "absgrid",
       .emitters = {kPolygon},
       .blocks = {kBlock},
       .has_room = true,
       .medium = on_grid(absorbing(three_gaussians(0.1)), 0.25)},
      {.name = "emihom", .blocks = {kBlock}, .has_room = true, .medium = emitting(even(0.5))},
      {.name = "emi",
       .blocks = {kBlock},
       .has_room = true,
       .medium = emitting(three_gaussians(0.05))},
      {.name = "emigrid",
       .blocks = {kBlock},
       .has_room = true,
       .medium = on_grid(emitting(three_gaussians(0.05)), 0.25)},
      {.name = "scatopen",
       .has_room = true,
       .medium = scattering(even(0.5)),
       .light = kLampOutside},
      {.name = "scatcard",
       .blocks = {kCard},
       .has_room = true,
       .medium = scattering(even(0.5)),
       .light = kLampOutside},
      {.name = "scat",
       .blocks = {kBlock, kPlate},
       .has_room = true,
       .medium = scattering(even(0.5)),
       .light = kLampInside},
      {.name = "scathg",
       .blocks = {kBlock, kPlate},
       .has_room = true,
       .medium = scattering(even(0.5), 0.6),
       .light = kLampInside},
      {.name = "scatg",
       .blocks = {kBlock, kPlate},
       .has_room = true,
       .medium = scattering(three_gaussians(0.1)),
       .light = kLampInside},
      {.name = "emiplate",
       .blocks = {kBlock, kPlate},
       .has_room = true,
       .medium = emitting(three_gaussians(0.05))},
      {.name = "scatthin",
       .blocks = {kPlate},
       .has_room = true,
       .medium = scattering(even(0.5)),
       .light = kLampOutside}};
  for (OracleScene& scene : scenes)
    if (scene.medium && !scene.medium->is_grid_fixed) scene.medium->grid_step = grid_step;
  return scenes;
}

OracleScene glossy_oracle_scene() {
  OracleEmitter polygon = kPolygon;
  polygon.radiance = 0.5;
  polygon.lobe = EmissionLobe{Vec3d(-1, 0.25, -0.45).normalized(), 20, Rgb(12.0f)};
  return {.name = "glossy",
          .emitters = {polygon},
          .blocks = {kBlock},
          .has_room = true,
          .medium = absorbing(even(0.3))};
}

OracleScene oracle_scene(const std::string& name, double grid_step) {
  std::string names;
  for (OracleScene& scene : oracle_scenes(grid_step)) {
    if (scene.name == name) return scene;
    names += (names.empty() ? "" : ", ") + scene.name;
  }
  throw Error(ErrorKind::InvalidInput,
              "oracle: " + printable(name) + ": no such scene: choose one of " + names);
}

const std::vector<OracleCase>& oracle_cases() {
  static const std::vector<OracleCase> cases{
      {"vac", {0.35, 0.20, 0}, 2.632746958, {-1.65891555, -0.95324315, 0}, false},
      {"vacblk", {-0.60, 0.25, 0}, 0.407757648, {0.11049384, 0.05166589, 0}, false},
      {"abs", {-0.60, 0.25, 0}, 0.072572128, {0.06848524, 0.01762510, 0}, false},
      {"abs", {-0.60, 0.25, 0.10}, 0.079226634, {0.09689411, 0.00804978, 0.05952258}, true},
      {"glossy", {-0.60, 0.25, 0}, 0.282420840, {-0.23525263, 0.17466033, 0}, false},
      {"emi", {-0.60, 0.25, 0}, 1.592641736, {0.32783592, 0.63808214, 0}, false},
      {"scatopen", {-1.00, 0.25, 0}, 0.043380124, {0.01740833, -0.00316348, 0}, false},
      {"scat", {-1.00, 0.25, 0}, 0.077483712, {0.01402990, 0.00502745, 0}, false},
      {"emiplate", {-1.00, 0.25, 0}, 1.254174772, {1.16654340, 0.58736108, 0}, false}};
  return cases;
}

Scene make_scene(const OracleScene& oracle) {
  Scene scene;
  scene.file = oracle.name + ".json";
  scene.up = {0, 0, 1};
  scene.render.bounces = 0;
  scene.render.volume_bounces = 1;
  for (OracleMesh& m : meshes_of(oracle)) {
    m.mesh.materials.assign(m.mesh.triangles.size(),
                            static_cast<std::uint32_t>(scene.materials.size()));
    scene.meshes.push_back(std::move(m.mesh));
    scene.materials.push_back(std::move(m.material));
  }
  if (oracle.light) scene.lights.push_back(*oracle.light);
  if (oracle.medium) {
    const OracleMedium& medium = *oracle.medium;
    const double scale = medium.is_homogeneous() ? medium.sigma_t.background : 1;
    Volume volume;
    volume.name = oracle.name;
    volume.sigma_s = RgbD(scale * medium.albedo);
    volume.sigma_a = RgbD(scale * (1 - medium.albedo));
    volume.phase = HenyeyGreenstein(medium.anisotropy);
    if (medium.emission > 0) {
      volume.emission.mode = Emission::Mode::Density;
      volume.emission.scale = medium.emission;
    }
    if (!medium.is_homogeneous()) {
      const Lattice lattice = medium_lattice(medium);
      volume.density = BrickGrid::from_dense(
          Vec3i(0), lattice.count, sample_field(medium.sigma_t, lattice), lattice.index_to_world());
    }
    scene.volumes.push_back(std::move(volume));
  }
  return scene;
}

std::vector<std::filesystem::path> write_oracle_scene(const OracleScene& oracle,
                                                      const std::filesystem::path& folder) {
  SceneJson json{{"version", 1}, {"up", "Z"}};
  std::vector<std::filesystem::path> files{folder / (oracle.name + ".json")};

  SceneJson materials = SceneJson::object(), meshes = SceneJson::array();
  for (const OracleMesh& m : meshes_of(oracle)) {
    SceneJson material{{"type", "diffuse"}, {"albedo", grey(m.material.albedo.r)}};
    if (m.material.is_emissive()) {
      material["emission"] = grey(m.material.emission.r);
      material["direct"] = false;
    }
    materials[m.material.name] = material;
    const std::string obj = oracle.name + "_" + m.mesh.name + ".obj";
    write_file_whole(folder / obj, obj_text({{m.mesh.name, m.material.name, m.mesh}}, ""));
    files.push_back(folder / obj);
    SceneJson mesh{{"file", obj}, {"material", m.material.name}};
    if (!m.mesh.casts_shadow) mesh["casts_shadow"] = false;
    meshes.push_back(mesh);
  }
  json["materials"] = materials;
  json["meshes"] = meshes;

  if (oracle.light)
    json["lights"] = SceneJson::array({{{"type", "point"},
                                        {"position", json_list(oracle.light->position)},
                                        {"intensity", grey(oracle.light->intensity.r)}}});
  if (oracle.medium) {
    const OracleMedium& medium = *oracle.medium;
    SceneJson volume;
    if (medium.is_homogeneous()) {
      const double sigma_t = medium.sigma_t.background;
      volume = {{"type", "homogeneous"},
                {"sigma_s", grey(sigma_t * medium.albedo)},
                {"sigma_a", grey(sigma_t * (1 - medium.albedo))}};
    } else {
      const std::string vdb = oracle.name + ".vdb";
      const Lattice lattice = medium_lattice(medium);
      write_grids(folder / vdb, {{.name = "density",
                                  .count = lattice.count,
                                  .values = sample_field(medium.sigma_t, lattice),
                                  .index_to_world = lattice.index_to_world()}});
      files.push_back(folder / vdb);
      volume = {{"type", "vdb"},
                {"file", vdb},
                {"grids", {{"density", "density"}}},
                {"density_scale", 1},
                {"albedo", grey(medium.albedo)}};
    }
    volume["anisotropy"] = medium.anisotropy;
    if (medium.emission > 0) volume["emission"] = {{"mode", "density"}, {"scale", medium.emission}};
    json["volumes"] = SceneJson::array({volume});
  }
  json["render"] = {{"bounces", 0}, {"volume_bounces", 1}};
  write_file_whole(files.front(), scene_text(json));
  return files;
}

}  // namespace brume
