// The scenes and meshes that come with the project's data, as they are.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <set>

#include "core/error.h"
#include "scene/mesh_import.h"
#include "scene/scene_file.h"
#include "scene/world.h"

namespace brume {
namespace {

const std::filesystem::path kData = BRUME_SHARED_DATA;

class SceneData : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kData / "scenes"))
      GTEST_SKIP() << "no data at " << kData << "; clone it beside the project";
  }
};

Box3d bounds(const std::vector<TriangleMesh>& meshes) {
  Box3d box;
  for (const TriangleMesh& mesh : meshes)
    for (const auto& t : mesh.triangles)
      for (const std::uint32_t i : t) box.extendBy(mesh.positions[i]);
  return box;
}

std::size_t triangle_count(const std::vector<TriangleMesh>& meshes) {
  std::size_t n = 0;
  for (const TriangleMesh& mesh : meshes) n += mesh.triangles.size();
  return n;
}

struct CornellCase {
  const char* file;
  double sigma_t;
  std::array<double, 3> centre;  // Of the README's world box, under the scene's transform.
};

class CornellScenes : public SceneData, public testing::WithParamInterface<CornellCase> {};

TEST_P(CornellScenes, LoadUnchanged) {
  const CornellCase& expected = GetParam();
  const Scene scene = load_scene(kData / "scenes" / expected.file, {});
  EXPECT_EQ(scene.unit, 0.01);
  ASSERT_TRUE(scene.camera);
  EXPECT_EQ(scene.camera->position, Vec3d(278, 273, 8));
  EXPECT_EQ(scene.film.width, 512);
  EXPECT_EQ(scene.render.volume_bounces, 1);
  // 17 quads and the floor's three, of which the front wall is commented out.
  EXPECT_EQ(triangle_count(scene.meshes), 36u);
  // Importers keep positions as floats.
  EXPECT_LT((bounds(scene.meshes).max - Vec3d(556, 548.8, 559.2)).length(), 1e-4);
  std::set<std::string> used;
  for (const TriangleMesh& mesh : scene.meshes)
    for (const std::uint32_t m : mesh.materials) used.insert(scene.materials.at(m).name);
  EXPECT_EQ(used, (std::set<std::string>{"white", "red", "green", "lamp"}));
  ASSERT_EQ(scene.lights.size(), 1u);
  EXPECT_EQ(std::get<SpotLight>(scene.lights[0]).outer_deg, 12);
  ASSERT_EQ(scene.volumes.size(), 1u);
  const Volume& volume = scene.volumes[0];
  EXPECT_NEAR(volume.sigma_t().g, expected.sigma_t, 1e-12);
  ASSERT_TRUE(volume.density);
  // The grid's own transform first, then the scene's.
  const Box3d box = volume.density->world_bounds(), room = bounds(scene.meshes);
  for (int a = 0; a < 3; ++a) {
    EXPECT_GT(box.min[a], room.min[a]) << "axis " << a;
    EXPECT_LT(box.max[a], room.max[a]) << "axis " << a;
    EXPECT_NEAR((box.min[a] + box.max[a]) / 2, expected.centre[std::size_t(a)],
                2 * volume.density->voxel_size())
        << "axis " << a;
  }
}

INSTANTIATE_TEST_SUITE_P(
    , CornellScenes,
    testing::Values(CornellCase{"cornell_smoke1.json", 0.04, {278, 244.9, 280}},
                    CornellCase{"cornell_teapot_cloud.json", 0.001, {276, 280, 280}},
                    CornellCase{"cornell_wdas_cloud.json", 0.06, {276, 300, 280}}));

TEST_F(SceneData, SmokyBoxLoadsUnchanged) {
  const Scene scene = load_scene(kData / "reference" / "smoky_box.json", {});
  EXPECT_EQ(scene.meshes.size(), 4u);
  EXPECT_EQ(scene.render.bounces, 64);
  EXPECT_FALSE(scene.render.volume_bounces);
  EXPECT_EQ(std::get<QuadLight>(scene.lights.at(0)).radiance, Rgb(25.0f));
  EXPECT_EQ(scene.volumes.at(0).sigma_t(), RgbD(1.0));
  EXPECT_NEAR(scene.volumes[0].sigma_s.r, 0.9, 1e-12);
  EXPECT_TRUE(scene.warnings.empty()) << scene.warnings.front();
}

TEST_F(SceneData, GivenScenesMakeWorlds) {
  const World world(load_scene(kData / "scenes" / "cornell_smoke1.json", {}));
  EXPECT_EQ(world.lights().size(), 2u);  // The spot and the lamp.
  EXPECT_TRUE(world.medium().scatters());
}

TEST_F(SceneData, GltfCornellBoxImportsWithItsCamera) {
  const ImportedFile file =
      import_mesh_file(kData / "meshes" / "cornellBox" / "cornellBox.gltf", {});
  ASSERT_EQ(file.cameras.size(), 1u);
  const Camera& camera = file.cameras[0].second;
  EXPECT_EQ(file.cameras[0].first, "default");
  EXPECT_NEAR(camera.position.z, 19.992092, 1e-5);
  EXPECT_NEAR(camera.fov_deg, 0.7175414562225342 * 180 / kPi, 1e-9);
  EXPECT_NEAR((camera.look_at - camera.position).z, -1, 1e-9);
  EXPECT_GT(triangle_count(file.meshes), 100u);
  const auto lamp = std::find_if(
      file.materials.begin(), file.materials.end(),
      [](const ImportedMaterial& m) { return m.material.name == "cube_instance_8_material"; });
  ASSERT_NE(lamp, file.materials.end());
  EXPECT_EQ(lamp->material.emission, Rgb(10.0f));
  // Walls of boxes 10 units apart, moved by their nodes.
  EXPECT_LT(bounds(file.meshes).min.z, -4);
}

TEST_F(SceneData, HomeTheaterImports) {
  const ImportedFile file =
      import_mesh_file(kData / "meshes" / "home-theater" / "home-theater.gltf", {});
  EXPECT_GT(triangle_count(file.meshes), 1000u);
  const auto purple =
      std::find_if(file.materials.begin(), file.materials.end(),
                   [](const ImportedMaterial& m) { return m.material.name == "mat1"; });
  ASSERT_NE(purple, file.materials.end());
  EXPECT_NEAR(purple->material.albedo.b, 0.69, 1e-6);
  EXPECT_FALSE(purple->material.is_glossy());
}

TEST_F(SceneData, MedievalBuildingImportsAndSaysWhatItDrops) {
  const ImportedFile file =
      import_mesh_file(kData / "meshes" / "medieval_building" / "Medieval_building.obj", {});
  EXPECT_GT(triangle_count(file.meshes), 10000u);
  const auto says = [&](const char* text) {
    return std::any_of(file.warnings.begin(), file.warnings.end(),
                       [&](const std::string& w) { return w.find(text) != std::string::npos; });
  };
  EXPECT_TRUE(says("images are dropped"));
  EXPECT_TRUE(says("highlights (Ks) are dropped"));
}

TEST_F(SceneData, BareVdbBecomesAScene) {
  for (const char* name : {"smoke1.vdb", "wdas_cloud_sixteenth.vdb", "torus_dense.vdb"}) {
    const VdbScene made = make_vdb_scene(kData / "vdb" / name, {});
    EXPECT_EQ(made.scene.volumes.size(), 1u) << name;
    EXPECT_EQ(made.scene.lights.size(), 2u) << name;
    ASSERT_TRUE(made.scene.camera) << name;
    // All of the volume lies inside the view's cone, by the sphere around it.
    const Box3d box = made.scene.volumes[0].density->world_bounds();
    const Camera& camera = *made.scene.camera;
    const double radius = (box.max - box.min).length() / 2;
    EXPECT_GT(
        (camera.position - camera.look_at).length() * std::sin(camera.fov_deg / 2 * kPi / 180),
        radius * 0.95)
        << name;
    // The ground lies below.
    EXPECT_LT(bounds(made.scene.meshes).max.y, box.min.y) << name;
    EXPECT_GE(made.notes.size(), 6u) << name;
  }
}

}  // namespace
}  // namespace brume
