#include "scene/mesh_import.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>

#include "core/error.h"
#include "scene/scene_file.h"
#include "support/scratch_folder.h"

namespace brume {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;

class MeshImportTest : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_.path() / name, std::ios::binary) << text;
    return folder_.path() / name;
  }
  ImportedFile import(const std::string& name, const std::string& text) const {
    return import_mesh_file(write(name, text), {});
  }
  Scene load(const std::string& text) const { return load_scene(write("scene.json", text), {}); }
  template <typename F>
  static std::string message_of(F work) {
    try {
      work();
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::InvalidInput) << e.what();
      return e.what();
    }
    ADD_FAILURE() << "nothing was thrown";
    return "";
  }

  ScratchFolder folder_;
};

Vec3d face_normal(const TriangleMesh& mesh, std::size_t i) {
  const auto& t = mesh.triangles.at(i);
  return (mesh.positions[t[1]] - mesh.positions[t[0]])
      .cross(mesh.positions[t[2]] - mesh.positions[t[0]])
      .normalized();
}

const Material& material(const ImportedFile& file, const std::string& name) {
  for (const ImportedMaterial& m : file.materials)
    if (m.material.name == name) return m.material;
  throw std::runtime_error("no material " + name);
}

// One triangle, in little-endian floats and shorts, as a glTF data URI.
std::string base64(const std::string& bytes) {
  static const char* kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k)
      word = word << 8 | (i + k < bytes.size() ? std::uint8_t(bytes[i + k]) : 0);
    for (std::size_t k = 0; k < 4; ++k)
      out += i + k <= bytes.size() ? kDigits[word >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

std::string triangle_bytes(std::uint16_t last_index = 2) {
  const float positions[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  const std::uint16_t indices[4] = {0, 1, last_index, 0};
  std::string bytes(44, '\0');
  std::memcpy(bytes.data(), positions, 36);
  std::memcpy(bytes.data() + 36, indices, 8);
  return bytes;
}

// `extra` members of the root, `nodes` and `material` as given; mesh 0 is the triangle.
std::string gltf(const std::string& nodes, const std::string& material = "{\"name\":\"m\"}",
                 const std::string& extra = "", const std::string& bytes = triangle_bytes(),
                 int index_count = 3) {
  return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[)" + nodes +
         R"(],"materials":[)" + material +
         R"(],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":0}]}],
         "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
                      {"bufferView":1,"componentType":5123,"count":)" +
         std::to_string(index_count) + R"(,"type":"SCALAR"}],
         "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8}],
         "buffers":[{"byteLength":44,"uri":"data:application/octet-stream;base64,)" +
         base64(bytes) + "\"}]" + extra + "}";
}

// ---- OBJ.

TEST_F(MeshImportTest, ObjWithMtlBringsMaterials) {
  write("m.mtl",
        "newmtl red\nKd 0.6 0.1 0.2\nnewmtl lamp\nKd 0 0 0\nKe 5 6 7\nnewmtl spare\nKd 1 1 1\n");
  const ImportedFile file =
      import("a.obj",
             "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nusemtl red\nf 1 2 3 4\n"
             "usemtl lamp\nf 1 2 3\n");
  ASSERT_EQ(file.meshes.size(), 1u);
  EXPECT_EQ(file.meshes[0].triangles.size(), 3u);
  EXPECT_TRUE(file.meshes[0].normals.empty()) << "no normals in the file: flat";
  EXPECT_EQ(face_normal(file.meshes[0], 0), Vec3d(0, 0, 1));
  EXPECT_EQ(material(file, "red").albedo, Rgb(0.6f, 0.1f, 0.2f));
  EXPECT_EQ(material(file, "lamp").emission, Rgb(5, 6, 7));
  EXPECT_NO_THROW(material(file, "spare"));
  EXPECT_TRUE(file.warnings.empty()) << file.warnings.front();
}

TEST_F(MeshImportTest, ObjKeepsNormalsOfTheFile) {
  const ImportedFile file =
      import("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0.6 0.8\nf 1//1 2//1 3//1\n");
  ASSERT_EQ(file.meshes.at(0).normals.size(), file.meshes[0].positions.size());
  EXPECT_LT((file.meshes[0].normals[0] - Vec3f(0, 0.6f, 0.8f)).length(), 1e-6f);
}

TEST_F(MeshImportTest, ConcavePolygonsKeepTheirArea) {
  // An L of area 3.
  const ImportedFile file = import("a.obj",
                                   "v 0 0 0\nv 2 0 0\nv 2 1 0\nv 1 1 0\nv 1 2 0\nv 0 2 0\n"
                                   "f 1 2 3 4 5 6\n");
  double area = 0;
  const TriangleMesh& mesh = file.meshes.at(0);
  for (const auto& t : mesh.triangles)
    area += (mesh.positions[t[1]] - mesh.positions[t[0]])
                .cross(mesh.positions[t[2]] - mesh.positions[t[0]])
                .z /
            2;
  EXPECT_NEAR(area, 3, 1e-6);
}

TEST_F(MeshImportTest, ObjSaysWhatItDrops) {
  write("m.mtl", "newmtl a\nKd 1.5 0 0\nKs 1 1 1\nNs 9\nmap_Kd wood.png\nd 0.5\n");
  const ImportedFile file =
      import("a.obj", "mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\n");
  EXPECT_THAT(file.warnings, Contains(HasSubstr("images are dropped")));
  EXPECT_THAT(file.warnings, Contains(HasSubstr("highlights (Ks)")));
  EXPECT_THAT(file.warnings, Contains(HasSubstr("become opaque")));
  EXPECT_THAT(file.warnings, Contains(HasSubstr("colours are clamped")));
  EXPECT_THAT(file.warnings, Contains(HasSubstr("points and lines")));
  EXPECT_EQ(material(file, "a").albedo, Rgb(1, 0, 0));
}

TEST_F(MeshImportTest, BadTrianglesAreDroppedAndCounted) {
  const ImportedFile file =
      import("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nf 1 2 3\nf 1 2 4\nf 1 1 2\n");
  EXPECT_EQ(file.meshes.at(0).triangles.size(), 1u);
  EXPECT_THAT(file.warnings, Contains(HasSubstr("2 triangles without area")));
}

TEST_F(MeshImportTest, ForeignObjsNeverCrash) {
  for (const char* text :
       {"f 1 2 3\n", "v 0 0 0\nf 1 2 3\n", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9999999999\n",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -9 -8 -7 -6 -5\n", "v a b c\nf x y z\n", "v 0 0\nf 1 1 1 1\n",
        "v nan inf 1e999\nv 1 0 0\nv 0 1 0\nv 0 2 0\nf 1 2 3 4\n", "mtllib\nusemtl\nf\n", "",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/9/9 2/9/9 3/9/9 1/9/9\n", "\xff\xfe\x00",
        "o\ng\ns\nvn\nvt\n"}) {
    try {
      for (const TriangleMesh& mesh : import("a.obj", text).meshes)
        for (const auto& t : mesh.triangles)
          for (const std::uint32_t i : t) EXPECT_LT(i, mesh.positions.size());
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::InvalidInput) << text;
    }
  }
}

TEST_F(MeshImportTest, RefusesOtherKindsOfFile) {
  EXPECT_THAT(message_of([&] { import("a.fbx", "x"); }), HasSubstr("export it as glTF"));
  EXPECT_THAT(message_of([&] { import("a.gltf", "{}"); }), HasSubstr("a.gltf: "));
  EXPECT_THAT(message_of([&] { import("a.glb", "glTF"); }), HasSubstr("damaged glb"));
  EXPECT_THAT(message_of([&] { import("a.ply", "ply\nformat"); }), HasSubstr("a.ply: "));
}

TEST_F(MeshImportTest, TrianglesAreLimited) {
  const auto file = write("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n");
  EXPECT_THAT(message_of([&] { import_mesh_file(file, {.confine = {}, .max_triangles = 1}); }),
              HasSubstr("more than 1 triangles"));
}

// ---- PLY.

TEST_F(MeshImportTest, PlyImports) {
  const ImportedFile file = import(
      "a.ply",
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n");
  ASSERT_EQ(file.meshes.size(), 1u);
  EXPECT_EQ(file.meshes[0].triangles.size(), 2u);
  EXPECT_TRUE(file.meshes[0].normals.empty());
}

TEST_F(MeshImportTest, PlyWithIndicesOutOfRangeIsRefused) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n";
  for (const char* face : {"3 0 1 7\n", "4 0 1 2 4000000\n", "3 0 1 -5\n"})
    EXPECT_THAT(message_of([&] { import("a.ply", head + face); }), HasSubstr("a.ply: ")) << face;
}

// ---- glTF.

TEST_F(MeshImportTest, GltfAppliesNodeTransforms) {
  const ImportedFile file = import("a.gltf", gltf(R"({"translation":[10,0,0],"children":[1]},
                        {"rotation":[0,0,0.70710678,0.70710678],"scale":[2,2,2],"mesh":0})"));
  const TriangleMesh& mesh = file.meshes.at(0);
  // (1,0,0) doubled, turned to y, moved.
  EXPECT_LT((mesh.positions.at(1) - Vec3d(10, 2, 0)).length(), 1e-5);
  EXPECT_LT((face_normal(mesh, 0) - Vec3d(0, 0, 1)).length(), 1e-6);
}

TEST_F(MeshImportTest, MirroredNodesKeepTheFrontOnTheMirroredSide) {
  const TriangleMesh mesh = import("a.gltf", gltf(R"({"scale":[1,1,-1],"mesh":0})")).meshes.at(0);
  EXPECT_EQ(face_normal(mesh, 0), Vec3d(0, 0, -1));
}

TEST_F(MeshImportTest, GltfMaterialsAreMapped) {
  const std::string metal_text =
      R"({"name":"metal","pbrMetallicRoughness":{"baseColorFactor":[0.8,0.6,0.4,1],
          "metallicFactor":0.75,"roughnessFactor":0.3}})";
  const std::string paint_text =
      R"({"name":"paint","pbrMetallicRoughness":{"baseColorFactor":[0.1,0.2,0.3,1],
          "metallicFactor":0},"emissiveFactor":[1,0.5,0],"doubleSided":true,
          "extensions":{"KHR_materials_emissive_strength":{"emissiveStrength":8}}})";
  const std::string extensions =
      R"(,"extensionsUsed":["KHR_materials_emissive_strength","KHR_materials_sheen"])";
  const ImportedFile metals = import("a.gltf", gltf(R"({"mesh":0})", metal_text, extensions));
  const ImportedFile paints =
      import("b.gltf", gltf(R"({"mesh":0})", paint_text + "," + metal_text, extensions));
  const Material &metal = material(metals, "metal"), &paint = material(paints, "paint");
  EXPECT_NO_THROW(material(paints, "metal")) << "unused, but it may be mapped";
  EXPECT_NEAR(metal.specular.r, 0.6, 1e-6);
  EXPECT_NEAR(metal.albedo.r, 0.2, 1e-6);
  EXPECT_NEAR(metal.roughness, 0.3, 1e-6);
  EXPECT_FALSE(paint.is_glossy());
  EXPECT_NEAR(paint.albedo.b, 0.3, 1e-6);
  EXPECT_NEAR(paint.emission.r, 8, 1e-6);
  EXPECT_NEAR(paint.emission.g, 4, 1e-6);
  EXPECT_TRUE(paint.two_sided);
  EXPECT_THAT(metals.warnings, Contains(HasSubstr("1 metallic materials become glossy")));
  EXPECT_THAT(metals.warnings,
              Contains(AllOf(HasSubstr("KHR_materials_sheen"), Not(HasSubstr("emissive")))));
}

TEST_F(MeshImportTest, GltfBringsCamerasAndLights) {
  const ImportedFile file = import(
      "a.gltf",
      gltf(
          R"({"children":[1,2,3,4],"mesh":0,"translation":[0,0,10]},
              {"camera":0,"rotation":[0,0.70710678118654757,0,0.70710678118654757]},
              {"extensions":{"KHR_lights_punctual":{"light":0}},"translation":[1,2,3]},
              {"extensions":{"KHR_lights_punctual":{"light":1}},"rotation":[-0.70710678118654757,0,0,0.70710678118654757]},
              {"extensions":{"KHR_lights_punctual":{"light":2}}})",
          "{\"name\":\"m\"}",
          R"(,"cameras":[{"type":"perspective","name":"eye","perspective":{"yfov":1.5707963267948966,"aspectRatio":2,"znear":0.1}}],
               "extensionsUsed":["KHR_lights_punctual"],
               "extensions":{"KHR_lights_punctual":{"lights":[
                 {"type":"point","color":[1,0.5,0],"intensity":683},
                 {"type":"directional","intensity":1366},
                 {"type":"spot","intensity":683,"range":5,"spot":{"innerConeAngle":0.1,"outerConeAngle":0.5}}]}})"));
  ASSERT_EQ(file.cameras.size(), 1u);
  EXPECT_EQ(file.cameras[0].first, "eye");
  EXPECT_NEAR(file.cameras[0].second.fov_deg, 90, 1e-9) << "vertical, whatever the aspect";
  const Vec3d view = file.cameras[0].second.look_at - file.cameras[0].second.position;
  EXPECT_LT((view - Vec3d(-1, 0, 0)).length(), 1e-9);
  ASSERT_EQ(file.lights.size(), 3u);
  const auto& point = std::get<PointLight>(file.lights[0]);
  EXPECT_EQ(point.position, Vec3d(1, 2, 13));
  EXPECT_LT(std::abs(point.intensity.g - 0.5), 1e-6);  // W/sr.
  const auto& sun = std::get<DirectionalLight>(file.lights[1]);
  EXPECT_LT((sun.direction - Vec3d(0, -1, 0)).length(), 1e-9);
  EXPECT_NEAR(sun.irradiance.r, 2, 1e-6);  // W/m^2.
  const auto& spot = std::get<SpotLight>(file.lights[2]);
  EXPECT_NEAR(spot.outer_deg, 0.5 * 180 / kPi, 1e-9);
  EXPECT_THAT(file.warnings, Contains(HasSubstr("range is dropped")));
}

TEST_F(MeshImportTest, ForeignGltfsNeverCrash) {
  const std::string node = R"({"mesh":0})";
  const std::vector<std::string> texts{
      gltf(node, "{}", "", triangle_bytes(77)),               // An index past the vertices.
      gltf(node, "{}", "", triangle_bytes(), 4000),           // More indices than bytes.
      gltf(node, "{}", "", triangle_bytes(), 2'000'000'000),  // A bomb.
      gltf(R"({"mesh":9})"),
      gltf(R"({"children":[0]})"),                            // Nowhere, and itself.
      gltf(R"({"children":[1]},{"children":[0],"mesh":0})"),  // A circle.
      gltf(R"({"mesh":0,"scale":[0,1,1]})"),
      gltf(R"({"mesh":0,"matrix":[1,2,3]})"),
      gltf(R"({"camera":5,"mesh":0})"),
      gltf(node, "{\"name\":\"m\"}", R"(,"buffers":[])")};
  for (const std::string& text : texts) {
    try {
      for (const TriangleMesh& mesh : import("a.gltf", text).meshes)
        for (const auto& t : mesh.triangles)
          for (const std::uint32_t i : t) EXPECT_LT(i, mesh.positions.size());
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::InvalidInput) << text;
    }
  }
}

// ---- In a scene.

TEST_F(MeshImportTest, MaterialsOfTheSceneReplaceThoseOfTheFile) {
  write("m.mtl", "newmtl a\nKd 0.1 0.1 0.1\nnewmtl b\nKd 0.2 0.2 0.2\n");
  write("a.obj",
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\nusemtl b\nf 1 2 3\n"
        "usemtl c\nf 1 2 3\n");
  const auto scene_with = [&](const std::string& rest) {
    return load(R"({"version": 1, "materials": {"white": {"albedo": [0.9,0.9,0.9]}},
      "meshes": [{"file": "a.obj")" +
                rest + "}]}");
  };
  const auto albedo = [](const Scene& scene, std::size_t triangle) {
    return scene.materials.at(scene.meshes.at(0).materials.at(triangle)).albedo.r;
  };
  Scene scene = scene_with(R"(, "material": "white")");
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(albedo(scene, i), 0.9f);
  scene = scene_with(R"(, "materials": {"b": "white"})");
  std::vector<float> found;
  for (std::size_t i = 0; i < 3; ++i) found.push_back(albedo(scene, i));
  EXPECT_THAT(found, testing::UnorderedElementsAre(0.1f, 0.9f, 0.5f));
  EXPECT_THAT(scene.warnings, Contains(AllOf(HasSubstr("material \"c\", which nothing defines"),
                                             HasSubstr("grey"))));
  EXPECT_THAT(message_of([&] { scene_with(R"(, "materials": {"bb": "white"})"); }),
              AllOf(HasSubstr(": /meshes/0/materials/bb: "), HasSubstr("did you mean \"b\"?")));
}

TEST_F(MeshImportTest, SurfacesWithoutMaterialBecomeGreyAndSaySo) {
  write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const Scene scene = load(R"({"version": 1, "meshes": [{"file": "a.obj"}]})");
  EXPECT_EQ(scene.materials.at(0).albedo, Rgb(0.5f));
  EXPECT_THAT(scene.warnings, Contains(HasSubstr("1 triangles without a material")));
}

TEST_F(MeshImportTest, MirroringTransformsKeepTheFront) {
  write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n");
  const Scene scene = load(R"({"version": 1, "materials": {"m": {}}, "meshes": [{"file": "a.obj",
    "material": "m", "casts_shadow": false, "transform": [1,0,0,5, 0,1,0,6, 0,0,-2,7, 0,0,0,1]}]})");
  const TriangleMesh& mesh = scene.meshes.at(0);
  EXPECT_EQ(mesh.positions.at(0), Vec3d(5, 6, 7));
  EXPECT_EQ(face_normal(mesh, 0), Vec3d(0, 0, -1));
  EXPECT_EQ(mesh.normals.at(0), Vec3f(0, 0, -1));
  EXPECT_FALSE(mesh.casts_shadow);
}

TEST_F(MeshImportTest, IncludeTakesCamerasAndLights) {
  write(
      "room.gltf",
      gltf(
          R"({"children":[1],"mesh":0},{"camera":0,"extensions":{"KHR_lights_punctual":{"light":0}}})",
          "{\"name\":\"m\"}",
          R"(,"cameras":[{"type":"perspective","name":"eye","perspective":{"yfov":1,"znear":0.1}}],
                 "extensions":{"KHR_lights_punctual":{"lights":[{"type":"directional","intensity":683}]}})"));
  const Scene scene = load(R"({"version": 1, "include": ["room.gltf"]})");
  EXPECT_EQ(scene.meshes.size(), 1u);
  EXPECT_EQ(scene.lights.size(), 1u);
  EXPECT_NEAR(scene.find_camera("eye").fov_deg, 180 / kPi, 1e-9);
  EXPECT_NEAR(scene.find_camera("").fov_deg, 180 / kPi, 1e-9);
  const Scene plain = load(R"({"version": 1, "meshes": [{"file": "room.gltf"}]})");
  EXPECT_TRUE(plain.lights.empty());
  EXPECT_THAT(plain.warnings, Contains(HasSubstr("/meshes/0/file: cameras and lights")));
  // The included sun would shine through endless haze.
  EXPECT_THAT(message_of([&] {
                load(R"({"version": 1, "include": ["room.gltf"],
                         "volumes": [{"type": "homogeneous", "sigma_a": [1,1,1]}]})");
              }),
              HasSubstr(": /volumes/0: it fills all space"));
}

}  // namespace
}  // namespace brume
