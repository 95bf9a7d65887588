// The scenes that data_gen writes: their bytes, and that the scene loader reads back what was
// meant.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "core/error.h"
#include "data_gen/oracle_scenes.h"
#include "data_gen/smoky_cornell.h"
#include "scene/scene_file.h"
#include "support/scratch_folder.h"

namespace brume {
namespace {

namespace fs = std::filesystem;

SmokyCornellOptions small_cornell() {
  SmokyCornellOptions options;
  options.resolution = 24;
  options.size_px = 32;
  return options;
}

TEST(SmokyCornell, WritesTheSameBytesForAnyNumberOfThreads) {
  const ScratchFolder a, b;
  SmokyCornellOptions options = small_cornell();
  options.threads = 1;
  const auto first = write_smoky_cornell(a.path(), options);
  options.threads = 3;
  const auto second = write_smoky_cornell(b.path(), options);
  ASSERT_EQ(first.size(), 4u);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_FALSE(read_bytes(first[i]).empty());
    EXPECT_EQ(read_bytes(first[i]), read_bytes(second[i])) << first[i];
  }
}

TEST(SmokyCornell, AnotherSeedIsOtherSmokeInTheSameBox) {
  const ScratchFolder a, b;
  SmokyCornellOptions options = small_cornell();
  const auto first = write_smoky_cornell(a.path(), options);
  options.seed += 1;
  const auto second = write_smoky_cornell(b.path(), options);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(read_bytes(first[i]), read_bytes(second[i]));
  EXPECT_NE(read_bytes(first[3]), read_bytes(second[3]));
}

TEST(SmokyCornell, AFlightIsNamedCamerasThatMoveLittleAtATime) {
  const ScratchFolder folder;
  SmokyCornellOptions options = small_cornell();
  options.flight_frames = 24;
  const Scene scene = load_scene(write_smoky_cornell(folder.path(), options).front(), {});
  ASSERT_EQ(scene.cameras.size(), 24u);
  ASSERT_TRUE(scene.cameras.contains("f00") && scene.cameras.contains("f23"));
  const Camera* last = nullptr;
  for (const auto& [name, camera] : scene.cameras) {
    if (last) {
      EXPECT_LT((camera.position - last->position).length(), 0.15) << name;
    }
    last = &camera;
  }
}

TEST(SmokyCornell, LoadsAsItWasMeant) {
  const ScratchFolder folder;
  const Scene scene = load_scene(write_smoky_cornell(folder.path(), small_cornell()).front(), {});
  EXPECT_TRUE(scene.warnings.empty()) << scene.warnings.front();
  EXPECT_EQ(scene.film.width, 32);
  EXPECT_EQ(scene.render.bounces, 3);
  EXPECT_FALSE(scene.render.volume_bounces);
  EXPECT_EQ(scene.render.cells_theta, 16);
  EXPECT_EQ(scene.render.cells_phi, 50);
  EXPECT_EQ(scene.lights.size(), 2u);
  ASSERT_EQ(scene.volumes.size(), 2u);
  EXPECT_EQ(scene.bad_voxels.total(), 0u);
  // Smoke stays inside the room, between the low block and the ceiling.
  const Box3d smoke = scene.volumes[0].world_bounds();
  ASSERT_FALSE(smoke.isEmpty());
  EXPECT_GT(smoke.min.y, 0.5);
  EXPECT_LE(smoke.max.y, 2 + 1e-9);
  EXPECT_GE(smoke.min.x, -1 - 1e-9);
  std::size_t triangles = 0;
  for (const TriangleMesh& mesh : scene.meshes) triangles += mesh.triangles.size();
  EXPECT_EQ(triangles, 5 * 2u + 2 * 12u);
}

TEST(SmokyCornell, RefusesSizesOutOfRange) {
  const ScratchFolder folder;
  for (const int resolution : {-1, 0, 1, 100000}) {
    SmokyCornellOptions options = small_cornell();
    options.resolution = resolution;
    EXPECT_THROW(write_smoky_cornell(folder.path(), options), Error) << resolution;
  }
  SmokyCornellOptions options = small_cornell();
  options.size_px = 0;
  EXPECT_THROW(write_smoky_cornell(folder.path(), options), Error);
  options = small_cornell();
  options.flight_frames = 1001;
  EXPECT_THROW(write_smoky_cornell(folder.path(), options), Error);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

class OracleScenes : public testing::TestWithParam<OracleScene> {};

// All triangles of a scene, with what they are made of, in the order of the file.
struct Face {
  Vec3d a, b, c;
  Rgb albedo, emission;
  bool casts_shadow;
};
std::vector<Face> faces(const Scene& scene) {
  std::vector<Face> all;
  for (const TriangleMesh& mesh : scene.meshes)
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      const auto& t = mesh.triangles[i];
      const Material& material = scene.materials[mesh.materials[i]];
      all.push_back({mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]],
                     material.albedo, material.emission, mesh.casts_shadow});
    }
  return all;
}

TEST_P(OracleScenes, FileAndMemoryAgree) {
  const ScratchFolder folder;
  const Scene memory = make_scene(GetParam());
  const Scene file = load_scene(write_oracle_scene(GetParam(), folder.path()).front(), {});
  EXPECT_TRUE(file.warnings.empty()) << file.warnings.front();
  EXPECT_EQ(file.up, memory.up);
  EXPECT_EQ(file.render.bounces, memory.render.bounces);
  EXPECT_EQ(file.render.volume_bounces, memory.render.volume_bounces);
  EXPECT_EQ(file.lights.size(), memory.lights.size());

  const std::vector<Face> a = faces(file), b = faces(memory);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    // Importers keep positions as floats.
    EXPECT_LT((a[i].a - b[i].a).length() + (a[i].b - b[i].b).length() + (a[i].c - b[i].c).length(),
              1e-6);
    EXPECT_EQ(a[i].albedo, b[i].albedo);
    EXPECT_EQ(a[i].emission, b[i].emission);
    EXPECT_EQ(a[i].casts_shadow, b[i].casts_shadow);
  }

  ASSERT_EQ(file.volumes.size(), memory.volumes.size());
  for (std::size_t i = 0; i < file.volumes.size(); ++i) {
    const Volume &v = file.volumes[i], &w = memory.volumes[i];
    EXPECT_EQ(v.phase.g(), w.phase.g());
    for (const Vec3d& p :
         {Vec3d(-0.6, 0.25, 0.1), Vec3d(0.43, -0.31, 0.87), Vec3d(0.1, 0.9, 1.4)}) {
      EXPECT_NEAR(v.density_at(p) * v.sigma_t().r, w.density_at(p) * w.sigma_t().r, 1e-6);
      EXPECT_NEAR(v.density_at(p) * v.sigma_s_at(p).r, w.density_at(p) * w.sigma_s_at(p).r, 1e-6);
      EXPECT_NEAR(v.emission_at(p).r, w.emission_at(p).r, 1e-6);
    }
  }
}

TEST_P(OracleScenes, MediumIsTheFormulaOfTheCase) {
  const OracleScene& oracle = GetParam();
  if (!oracle.medium) {
    EXPECT_TRUE(make_scene(oracle).volumes.empty());
    return;
  }
  const Scene scene = make_scene(oracle);
  const Volume& volume = scene.volumes.at(0);
  // A node of every grid, where interpolation adds nothing.
  const Vec3d p(0.5, -0.25, 1.0);
  const double sigma_t = density(oracle.medium->sigma_t, p);
  EXPECT_NEAR(volume.density_at(p) * volume.sigma_t().r, sigma_t, 1e-6);
  EXPECT_NEAR(volume.density_at(p) * volume.sigma_s_at(p).r, oracle.medium->albedo * sigma_t, 1e-6);
  EXPECT_NEAR(volume.emission_at(p).r, oracle.medium->emission * sigma_t, 1e-6);
}

INSTANTIATE_TEST_SUITE_P(All, OracleScenes, testing::ValuesIn(oracle_scenes(0.25)),
                         [](const auto& instance) { return instance.param.name; });

// E of a polygon of even radiance from its edges alone [Lambert 1760]: L/2 sum of edge angle times
// the cosine between the edge's plane and the normal.
double polygon_irradiance(const OracleEmitter& e, const Vec3d& x, const Vec3d& n) {
  const Vec3d corners[4] = {e.corner, e.corner + e.edge_u, e.corner + e.edge_u + e.edge_v,
                            e.corner + e.edge_v};
  double sum = 0;
  for (int i = 0; i < 4; ++i) {
    const Vec3d a = (corners[i] - x).normalized(), b = (corners[(i + 1) % 4] - x).normalized();
    sum += std::acos(a.dot(b)) * a.cross(b).normalized().dot(n);
  }
  return e.radiance / 2 * std::abs(sum);
}

TEST(OracleCases, TheVacuumCaseIsLambertsPolygonFormula) {
  const OracleCase& vac = oracle_cases().front();
  ASSERT_EQ(vac.scene, "vac");
  const OracleEmitter patch = oracle_scene("vac").emitters.at(0);
  const auto irradiance = [&](const Vec3d& x) { return polygon_irradiance(patch, x, {0, 0, 1}); };
  EXPECT_NEAR(irradiance(vac.position), vac.irradiance, 1e-9);
  constexpr double kStep = 1e-4;
  const Vec3d dx(kStep, 0, 0), dy(0, kStep, 0);
  EXPECT_NEAR((irradiance(vac.position + dx) - irradiance(vac.position - dx)) / (2 * kStep),
              vac.gradient.x, 1e-6);
  EXPECT_NEAR((irradiance(vac.position + dy) - irradiance(vac.position - dy)) / (2 * kStep),
              vac.gradient.y, 1e-6);
}

TEST(OracleCases, EachIsOfASceneThatExists) {
  for (const OracleCase& c : oracle_cases()) {
    if (c.scene == glossy_oracle_scene().name) continue;  // No scene file can say it.
    EXPECT_NO_THROW(oracle_scene(c.scene)) << c.scene;
  }
}

TEST(OracleScene, EmittersFaceTheWayTheCaseSays) {
  const OracleEmitter down = oracle_scene("vac").emitters.at(0),
                      side = oracle_scene("abs").emitters.at(0);
  EXPECT_EQ(down.edge_u.cross(down.edge_v).normalized(), Vec3d(0, 0, -1));
  EXPECT_EQ(side.edge_u.cross(side.edge_v).normalized(), Vec3d(-1, 0, 0));
}

TEST(OracleScene, RefusesAnUnknownNameAndListsTheOthers) {
  try {
    oracle_scene("vacuum");
    FAIL() << "accepted";
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
    EXPECT_NE(std::string(e.what()).find("vacblk"), std::string::npos);
  }
}

}  // namespace
}  // namespace brume
