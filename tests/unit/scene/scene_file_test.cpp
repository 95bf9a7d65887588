#include "scene/scene_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/error.h"
#include "support/scratch_folder.h"
#include "vdb_media/grid_writer.h"

namespace brume {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

class SceneFileTest : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_.path() / name, std::ios::binary) << text;
    return folder_.path() / name;
  }
  // Of the file alone.
  Scene check(const std::string& text, const std::vector<std::string>& overrides = {}) const {
    SceneFileOptions options;
    options.load_data = false;
    options.overrides = overrides;
    return load_scene(write("scene.json", text), options);
  }
  Scene load(const std::string& text, const SceneFileOptions& options = {}) const {
    return load_scene(write("scene.json", text), options);
  }
  template <typename F>
  static std::string message_of(F work, ErrorKind kind = ErrorKind::InvalidInput) {
    try {
      work();
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), kind) << e.what();
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
      return e.what();
    }
    ADD_FAILURE() << "nothing was thrown";
    return "";
  }
  std::string refusal(const std::string& text,
                      const std::vector<std::string>& overrides = {}) const {
    const std::string message = message_of([&] { check(text, overrides); });
    EXPECT_THAT(message, StartsWith((folder_.path() / "scene.json").string() + ": "));
    return message;
  }

  ScratchFolder folder_;
};

// Grids of one value in `count`^3 voxels, at the same place.
void write_constant_grids(const std::filesystem::path& file, const std::vector<std::string>& names,
                          int count, float value, const Affine3d& index_to_world = {}) {
  std::vector<GridToWrite> grids;
  for (const std::string& name : names) {
    GridToWrite grid;
    grid.name = name;
    grid.count = Vec3i(count);
    grid.values.assign(std::size_t(count) * count * count, value);
    grid.index_to_world = index_to_world;
    grids.push_back(grid);
  }
  write_grids(file, grids);
}

const std::string kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

// ---- What the example says arrives.

TEST_F(SceneFileTest, ExampleArrivesWhole) {
  const Scene scene = check(scene_example());
  EXPECT_EQ(scene.unit, 1);
  EXPECT_EQ(scene.up, Vec3d(0, 1, 0));
  ASSERT_TRUE(scene.camera);
  EXPECT_EQ(scene.camera->position, Vec3d(0, 1, 4));
  EXPECT_EQ(scene.camera->fov_deg, 40);
  EXPECT_EQ(scene.cameras.at("top").up, Vec3d(0, 0, -1));
  EXPECT_EQ(scene.film.width, 1024);
  EXPECT_EQ(scene.film.height, 768);

  ASSERT_EQ(scene.materials.size(), 3u);  // By name.
  const Material &floor = scene.materials[0], &glow = scene.materials[1],
                 &white = scene.materials[2];
  EXPECT_EQ(floor.name, "floor");
  EXPECT_EQ(floor.specular, Rgb(0.5f));
  EXPECT_EQ(floor.roughness, 0.2f);
  EXPECT_EQ(glow.emission, Rgb(4.0f));
  EXPECT_FALSE(glow.direct);
  EXPECT_EQ(white.albedo, Rgb(0.75f));
  EXPECT_FALSE(white.is_glossy());

  ASSERT_EQ(scene.lights.size(), 5u);
  EXPECT_EQ(std::get<PointLight>(scene.lights[0]).intensity, Rgb(10.0f));
  EXPECT_EQ(std::get<SpotLight>(scene.lights[1]).inner_deg, 10);
  EXPECT_EQ(std::get<SpotLight>(scene.lights[1]).outer_deg, 14);
  EXPECT_EQ(std::get<DirectionalLight>(scene.lights[2]).direction, Vec3d(0, -1, 0));
  EXPECT_EQ(std::get<DirectionalLight>(scene.lights[2]).irradiance, Rgb(3.0f));
  EXPECT_EQ(std::get<QuadLight>(scene.lights[3]).edge_v, Vec3d(0, 0, 1));
  EXPECT_EQ(std::get<EnvironmentLight>(scene.lights[4]).file, folder_.path() / "sky.exr");

  ASSERT_EQ(scene.volumes.size(), 2u);
  const Volume& smoke = scene.volumes[0];
  EXPECT_EQ(smoke.name, "smoke.vdb");
  EXPECT_NEAR(smoke.sigma_s.g, 8 * 0.9, 1e-12);
  EXPECT_NEAR(smoke.sigma_t().b, 8, 1e-12);
  EXPECT_EQ(smoke.phase.g(), 0.3);
  EXPECT_EQ(smoke.emission.mode, Emission::Mode::Blackbody);
  EXPECT_EQ(smoke.emission.temperature_scale, 1800);
  EXPECT_EQ(smoke.emission.scale, 0.2);
  const Volume& haze = scene.volumes[1];
  EXPECT_EQ(haze.sigma_s, RgbD(0.01));
  EXPECT_EQ(haze.sigma_a, RgbD(0.0));
  EXPECT_EQ(haze.bounds.min, Vec3d(-5, 0, -5));
  EXPECT_EQ(haze.bounds.max, Vec3d(5, 3, 5));

  EXPECT_EQ(scene.render.bounces, 4);
  EXPECT_FALSE(scene.render.volume_bounces);
  EXPECT_EQ(scene.render.cells_phi, 50);
  EXPECT_EQ(scene.cache.file, folder_.path() / "shot.irc");
  EXPECT_EQ(scene.cache.mode, CacheMode::Missing);
  ASSERT_EQ(scene.outputs.size(), 1u);
  EXPECT_EQ(scene.outputs[0].aovs,
            (std::vector<std::string>{"beauty", "diffuse_indirect", "volume_direct"}));
}

TEST_F(SceneFileTest, SmallestSceneHasDefaults) {
  const Scene scene = check(R"({"version": 1})");
  EXPECT_FALSE(scene.camera);
  EXPECT_EQ(scene.film.width, 640);
  EXPECT_EQ(scene.render.bounces, 4);
  EXPECT_EQ(scene.render.seed, 1u);
  EXPECT_TRUE(scene.cache.file.empty());
  EXPECT_TRUE(scene.outputs.empty());
}

TEST_F(SceneFileTest, ByteOrderMarkAndCommentsAreFine) {
  EXPECT_EQ(check("\xEF\xBB\xBF// smoke\n{\"version\": 1, // one\n \"unit\": 2}\n").unit, 2);
}

TEST_F(SceneFileTest, CameraUpFollowsTheScenesUp) {
  const Scene scene =
      check(R"({"version": 1, "up": "Z", "camera": {"position": [0,-4,0], "look_at": [0,0,0]}})");
  EXPECT_EQ(scene.camera->up, Vec3d(0, 0, 1));
}

TEST_F(SceneFileTest, CoefficientsMayReplaceScaleAndAlbedo) {
  const Scene scene = check(R"({"version": 1, "volumes": [
    {"type": "homogeneous", "bounds": [[0,0,0],[1,1,1]], "sigma_a": [1,2,3]},
    {"type": "homogeneous", "bounds": [[0,0,0],[1,1,1]], "density_scale": 4, "albedo": [0,0.5,1]},
    {"type": "vdb", "file": "a.vdb"}]})");
  EXPECT_EQ(scene.volumes[0].sigma_s, RgbD(0.0));
  EXPECT_EQ(scene.volumes[0].sigma_a, RgbD(1, 2, 3));
  EXPECT_EQ(scene.volumes[1].sigma_s, RgbD(0, 2, 4));
  EXPECT_EQ(scene.volumes[1].sigma_a, RgbD(4, 2, 0));
  EXPECT_NEAR(scene.volumes[2].sigma_t().r, 1, 1e-12);
}

TEST_F(SceneFileTest, DirectionsBecomeUnitLength) {
  const Scene scene = check(R"({"version": 1, "lights": [
    {"type": "directional", "direction": [0,0,-8], "irradiance": [1,1,1]}]})");
  EXPECT_EQ(std::get<DirectionalLight>(scene.lights[0]).direction, Vec3d(0, 0, -1));
}

// ---- Overrides.

TEST_F(SceneFileTest, OverridesReplaceCreateAndAppend) {
  const Scene scene = check(
      scene_example(),
      {"/camera/fov_deg=55", "/render/volume_bounces=3", "/volumes/0/emission/mode=none",
       "/volumes/0/emission={}", "/cameras/side/position=[9,0,0]", "/cameras/side/look_at=[0,0,0]",
       "/lights/-={\"type\": \"point\", \"position\": [1,2,3], \"intensity\": [1,1,1]}",
       "/lights/0/intensity/1=7", "/cache/mode=read"});
  EXPECT_EQ(scene.camera->fov_deg, 55);
  EXPECT_EQ(scene.render.volume_bounces, 3);
  EXPECT_EQ(scene.volumes[0].emission.mode, Emission::Mode::None);
  EXPECT_EQ(scene.cameras.at("side").position, Vec3d(9, 0, 0));
  EXPECT_EQ(std::get<PointLight>(scene.lights.at(5)).position, Vec3d(1, 2, 3));
  EXPECT_EQ(std::get<PointLight>(scene.lights[0]).intensity, Rgb(10, 7, 10));
  EXPECT_EQ(scene.cache.mode, CacheMode::Read);
}

TEST_F(SceneFileTest, OverridesEscapeSlashAndTilde) {
  const Scene scene =
      check(R"({"version": 1, "materials": {"a/b~c": {}}})", {"/materials/a~1b~0c/albedo=[1,0,0]"});
  EXPECT_EQ(scene.materials[0].albedo, Rgb(1, 0, 0));
}

TEST_F(SceneFileTest, OverrideErrorsNameTheOverride) {
  const std::string example = scene_example();
  EXPECT_THAT(refusal(example, {"/camera/fov_deg=abc"}),
              AllOf(HasSubstr(": /camera/fov_deg: "), HasSubstr("-D /camera/fov_deg=abc"),
                    HasSubstr("expected a number")));
  EXPECT_THAT(refusal(example, {"/camera={}"}),
              AllOf(HasSubstr(": /camera: "), HasSubstr("-D /camera={}")));
  EXPECT_THAT(refusal(example, {"/camra/fov_deg=3"}),
              AllOf(HasSubstr(": /camra: "), HasSubstr("-D /camra/fov_deg=3"),
                    HasSubstr("did you mean \"camera\"?")));
  EXPECT_THAT(refusal(example, {"/lights/9=3"}), AllOf(HasSubstr(": /lights/9: "), HasSubstr("5")));
  EXPECT_THAT(refusal(example, {"/lights/x=3"}), HasSubstr(": /lights/x: "));
  EXPECT_THAT(refusal(example, {"/unit/x=3"}), HasSubstr(": /unit: "));
  EXPECT_THAT(refusal(example, {"/unit=1e400"}), HasSubstr(": /unit: "));
  // A fault elsewhere is not blamed on it.
  EXPECT_THAT(refusal(R"({"version": 1, "unit": 0})", {"/up=Z"}), Not(HasSubstr("-D")));
}

TEST_F(SceneFileTest, MalformedOverridesAreUsageErrors) {
  for (const char* text : {"unit=3", "/unit", "", "=", "/=3"}) {
    const std::string message =
        message_of([&] { check(R"({"version": 1})", {text}); }, ErrorKind::Usage);
    EXPECT_THAT(message, HasSubstr("-D ")) << text;
  }
}

// ---- Refusals by the table: pointer and reason of each.

struct Refusal {
  const char* override;  // On the example.
  const char* pointer;
  const char* reason;
};

class SceneFileRefusals : public SceneFileTest, public testing::WithParamInterface<Refusal> {};

TEST_P(SceneFileRefusals, NameThePlaceAndTheReason) {
  const Refusal& r = GetParam();
  const std::string message = refusal(scene_example(), {r.override});
  EXPECT_THAT(message, HasSubstr(std::string(".json: ") + r.pointer + ": "));
  EXPECT_THAT(message, HasSubstr(r.reason));
}

INSTANTIATE_TEST_SUITE_P(
    Table, SceneFileRefusals,
    testing::Values(
        Refusal{"/version=2", "/version", ": this brume reads 1"},
        Refusal{"/version=1.5", "/version", "expected an integer"},
        Refusal{"/unit=0", "/unit", "is outside"}, Refusal{"/unit=-1", "/unit", "is outside"},
        Refusal{"/unit=null", "/unit", "found null"},
        Refusal{"/up=y", "/up", "did you mean \"Y\"?"}, Refusal{"/up=7", "/up", "one of X, Y, Z"},
        Refusal{"/include=room.glb", "/include", "expected a list of strings"},
        Refusal{"/include/0=3", "/include/0", "expected a path"},
        Refusal{"/include/1=room.glb", "/include/1", "twice"},
        Refusal{"/camera=[]", "/camera", "expected an object, a camera"},
        Refusal{"/camera={\"look_at\":[0,0,0]}", "/camera", "\"position\" is missing"},
        Refusal{"/camera/position=[0,1]", "/camera/position", "expected 3 numbers"},
        Refusal{"/camera/position=[0,1,\"a\"]", "/camera/position/2", "expected a number"},
        Refusal{"/camera/position=[0,1,1e300]", "/camera/position/2", "is outside"},
        Refusal{"/camera/fov_deg=0", "/camera/fov_deg", "0 is outside (0, 180)"},
        Refusal{"/camera/fov_deg=180", "/camera/fov_deg", "is outside (0, 180)"},
        Refusal{"/camera/fov=40", "/camera/fov", "did you mean \"fov_deg\"?"},
        Refusal{"/cameras/top=1", "/cameras/top", "expected an object, a camera"},
        Refusal{"/cameras/={}", "/cameras/", "the name is empty"},
        Refusal{"/film/resolution=[0,5]", "/film/resolution/0", "is outside [1, 65536]"},
        Refusal{"/film/resolution=[5,65537]", "/film/resolution/1", "is outside"},
        Refusal{"/film/resolution=[5.5,5]", "/film/resolution/0", "expected an integer"},
        Refusal{"/film/resolution=[5]", "/film/resolution", "expected 2 integers"},
        Refusal{"/meshes={}", "/meshes", "expected a list of mesh objects"},
        Refusal{"/meshes/0/file=3", "/meshes/0/file", "expected a path"},
        Refusal{"/meshes/0={}", "/meshes/0", "\"file\" is missing"},
        Refusal{"/meshes/0/casts_shadow=1", "/meshes/0/casts_shadow", "expected true or false"},
        Refusal{"/meshes/1/materials/mtl_name=3", "/meshes/1/materials/mtl_name",
                "expected a name"},
        Refusal{"/meshes/0/transform=[1,0,0]", "/meshes/0/transform", "16 numbers"},
        Refusal{"/meshes/0/transform=[1,0,0,0,0,1,0,0,0,0,0,0,0,0,0,1]", "/meshes/0/transform",
                "singular"},
        Refusal{"/meshes/0/transform=[1,0,0,0,1,0,0,0,0,0,1,0,0,0,0,1]", "/meshes/0/transform",
                "singular"},
        Refusal{"/meshes/0/transform=[1,0,0,0,0,1,0,0,0,0,1,0,4,5,6,1]", "/meshes/0/transform/12",
                "last row"},
        Refusal{"/materials/white/albedo=[0,0,1.01]", "/materials/white/albedo/2",
                "1.01 is outside [0, 1]"},
        Refusal{"/materials/white/albedo=[-0.1,0,0]", "/materials/white/albedo/0",
                "outside [0, 1]"},
        Refusal{"/materials/white/type=mirror", "/materials/white/type", "diffuse, glossy"},
        Refusal{"/materials/white/roughness=0.5", "/materials/white/roughness",
                "type \"diffuse\" has no such key"},
        Refusal{"/materials/floor/roughness=0", "/materials/floor/roughness", "outside [0.01, 1]"},
        Refusal{"/materials/glow/emission=[-1,0,0]", "/materials/glow/emission/0", "is outside"},
        Refusal{"/lights/0/type=sun", "/lights/0/type", "known are point, spot"},
        Refusal{"/lights/0={\"position\":[0,0,0]}", "/lights/0", "\"type\" is missing"},
        Refusal{"/lights/0/radiance=[1,1,1]", "/lights/0/radiance",
                "type \"point\" has no such key"},
        Refusal{"/lights/0/intensity=[-1,0,0]", "/lights/0/intensity/0", "is outside"},
        Refusal{"/lights/1/outer_deg=91", "/lights/1/outer_deg", "(0, 90]"},
        Refusal{"/lights/"
                "3={\"type\":\"quad\",\"corner\":[0,0,0],\"edge_u\":[1,0,0],\"edge_v\":[0,1,0]}",
                "/lights/3", "\"radiance\" is missing"},
        Refusal{"/lights/4/scale=-1", "/lights/4/scale", "is outside"},
        Refusal{"/volumes/0/albedo=[1,1,2]", "/volumes/0/albedo/2", "2 is outside [0, 1]"},
        Refusal{"/volumes/0/albeod=[1,1,1]", "/volumes/0/albeod", "did you mean \"albedo\"?"},
        Refusal{"/volumes/0/anisotropy=1", "/volumes/0/anisotropy", "outside (-1, 1)"},
        Refusal{"/volumes/0/anisotropy=-1.5", "/volumes/0/anisotropy", "outside (-1, 1)"},
        Refusal{"/volumes/0/density_scale=-1", "/volumes/0/density_scale", "is outside"},
        Refusal{"/volumes/0/bounds=[[0,0,0],[1,1,1]]", "/volumes/0/bounds",
                "type \"vdb\" has no such key"},
        Refusal{"/volumes/0/grids/velocity=v", "/volumes/0/grids/velocity", "known are density"},
        Refusal{"/volumes/0/emission/mode=fire", "/volumes/0/emission/mode", "known are none"},
        Refusal{"/volumes/0/emission/color=[1,1,1]", "/volumes/0/emission/color",
                "mode \"blackbody\" has no such key"},
        Refusal{"/volumes/0/transform=[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,1]", "/volumes/0/transform",
                "singular"},
        Refusal{"/volumes/1/bounds=[[0,0,0],[1,0,1]]", "/volumes/1/bounds/1/1", "not above"},
        Refusal{"/volumes/1/bounds=[[0,0,0]]", "/volumes/1/bounds", "expected [[min"},
        Refusal{"/volumes/1/file=a.vdb", "/volumes/1/file", "type \"homogeneous\" has no such key"},
        Refusal{"/render/bounces=-1", "/render/bounces", "is outside"},
        Refusal{"/render/volume_bounces=all", "/render/volume_bounces", "\"auto\" or an integer"},
        Refusal{"/render/seed=-4", "/render/seed", "is outside"},
        Refusal{"/render/cells=[16,0]", "/render/cells/1", "is outside"},
        Refusal{"/render/step_rate=1", "/render/step_rate", "unknown key"},
        Refusal{"/cache={\"mode\":\"new\"}", "/cache", "\"file\" is missing"},
        Refusal{"/cache/mode=write", "/cache/mode", "known are new, append, missing, read"},
        Refusal{"/outputs/0/aovs/0=beaty", "/outputs/0/aovs/0", "did you mean \"beauty\"?"},
        Refusal{"/outputs/0/aovs/1=beauty", "/outputs/0/aovs/1", "twice"}));

// What lies between keys.
INSTANTIATE_TEST_SUITE_P(
    Meaning, SceneFileRefusals,
    testing::Values(
        Refusal{"/camera/look_at=[0,1,4]", "/camera/look_at", "same point as position"},
        Refusal{"/camera/up=[0,0,0]", "/camera/up", "no length"},
        Refusal{"/camera/up=[0,0,5]", "/camera/up", "parallel to up"},
        Refusal{"/film/resolution=[65536,65536]", "/film/resolution", "2^28"},
        Refusal{"/lights/1/inner_deg=15", "/lights/1/inner_deg", "larger than the outer"},
        Refusal{"/lights/1/direction=[0,0,0]", "/lights/1/direction", "needs a length"},
        Refusal{"/lights/2/direction=[0,0,0]", "/lights/2/direction", "needs a length"},
        Refusal{"/lights/3/edge_v=[2,0,0]", "/lights/3/edge_v", "span no area"},
        Refusal{"/lights/4/radiance=[1,1,1]", "/lights/4", "both file and radiance"},
        Refusal{"/lights/4={\"type\":\"environment\"}", "/lights/4", "neither file nor radiance"},
        Refusal{"/meshes/0/material=whit", "/meshes/0/material", "did you mean \"white\"?"},
        Refusal{"/meshes/1/materials/mtl_name=blue", "/meshes/1/materials/mtl_name",
                "no material is named \"blue\""},
        Refusal{"/volumes/0/sigma_s=[1,1,1]", "/volumes/0/density_scale", "beside sigma_s"},
        Refusal{"/volumes/1/albedo=[1,1,1]", "/volumes/1/albedo", "beside sigma_s"},
        Refusal{"/volumes/1={\"type\":\"homogeneous\"}", "/volumes/1", "no extinction"},
        Refusal{"/volumes/1={\"type\":\"homogeneous\",\"sigma_a\":[1,1,1]}", "/volumes/1",
                "fills all space"},
        Refusal{"/volumes/1/emission={\"mode\":\"grid\"}", "/volumes/1/emission/mode",
                "has no grids"},
        Refusal{"/volumes/1/emission={\"mode\":\"blackbody\"}", "/volumes/1/emission/mode",
                "has no grids"},
        Refusal{"/volumes/0/grids/density=\"\"", "/volumes/0/grids/density", "name is empty"}));

// Paths that can be none (T13).
INSTANTIATE_TEST_SUITE_P(
    Paths, SceneFileRefusals,
    testing::Values(Refusal{"/meshes/0/file=\"\"", "/meshes/0/file", "path is empty"},
                    Refusal{"/meshes/0/file=\"a\\u0000b\"", "/meshes/0/file", "NUL"},
                    Refusal{"/meshes/0/file=file:///etc/passwd", "/meshes/0/file", "is a URL"},
                    Refusal{"/meshes/0/file=http://x/y.obj", "/meshes/0/file", "is a URL"},
                    Refusal{"/meshes/0/file=${BRUME_NOT_SET}/a.obj", "/meshes/0/file",
                            "the environment has no BRUME_NOT_SET"},
                    Refusal{"/meshes/0/file=${HOME", "/meshes/0/file", "without its }"},
                    Refusal{"/volumes/0/file=smoke.####.vdb", "/volumes/0/file", "add --frame N"}));

TEST_F(SceneFileTest, UnboundedMediumIsFineWithNearLights) {
  const Scene scene = check(R"({"version": 1,
    "lights": [{"type": "point", "position": [0,0,0], "intensity": [1,1,1]}],
    "volumes": [{"type": "homogeneous", "sigma_s": [1,1,1]}]})");
  EXPECT_EQ(scene.volumes[0].bounds.max.x, kInfinity);
}

// ---- JSON itself (T14).

TEST_F(SceneFileTest, RefusesWhatIsNoJson) {
  EXPECT_THAT(refusal(""), HasSubstr("the file is empty"));
  EXPECT_THAT(refusal(" \n\t"), HasSubstr("the file is empty"));
  EXPECT_THAT(refusal("v 0 0 0\n"), HasSubstr("line 1, column 1"));
  EXPECT_THAT(refusal("{\"version\": 1,\n \"unit\": }"), HasSubstr("line 2"));
  EXPECT_THAT(refusal("{\"version\": 1"), HasSubstr("line 1"));
  EXPECT_THAT(refusal("{\"version\": 1} extra"), HasSubstr("line 1"));
  EXPECT_THAT(refusal("[1]"), HasSubstr("expected an object, a scene"));
  EXPECT_THAT(refusal("null"), HasSubstr("expected an object, a scene"));
  EXPECT_THAT(refusal("{}"), HasSubstr(": /: the key \"version\" is missing"));
}

TEST_F(SceneFileTest, RefusesDuplicateKeys) {
  EXPECT_THAT(refusal(R"({"version": 1, "film": {}, "film": {}})"),
              AllOf(HasSubstr(": /film: "), HasSubstr("twice")));
  EXPECT_THAT(refusal(R"({"version": 1, "lights": [{}, {"type": "quad", "type": "spot"}]})"),
              AllOf(HasSubstr(": /lights/1/type: "), HasSubstr("twice")));
}

TEST_F(SceneFileTest, RefusesInvalidUtf8) {
  EXPECT_THAT(refusal("{\"version\": 1, \"materials\": {\"\xff\xfe\": {}}}"), HasSubstr("UTF-8"));
  EXPECT_THAT(refusal("{\"version\": 1, \"up\": \"\xc3\x28\"}"), HasSubstr("UTF-8"));
}

TEST_F(SceneFileTest, RefusesNumbersBeyondDouble) {
  EXPECT_THAT(refusal(R"({"version": 1, "camera": {"fov_deg": 1e400}})"),
              AllOf(HasSubstr("1e400"), HasSubstr("/camera")));
  EXPECT_THAT(refusal(R"({"version": 1, "unit": -1e999})"), HasSubstr("-1e999"));
  EXPECT_THAT(refusal(R"({"version": 1, "unit": NaN})"), HasSubstr("line 1"));
}

TEST_F(SceneFileTest, RefusesBottomlessNesting) {
  std::string lists = R"({"version": 1, "include": )", objects = R"({"version": 1, "film": )";
  for (int i = 0; i < 100'000; ++i) {
    lists += '[';
    objects += "{\"a\":";
  }
  EXPECT_THAT(refusal(lists), HasSubstr("nested deeper"));
  EXPECT_THAT(refusal(objects), HasSubstr("nested deeper"));
  EXPECT_THAT(refusal(R"({"version": 1})", {"/film=" + std::string(100'000, '[')}),
              HasSubstr(": /film: "));
}

TEST_F(SceneFileTest, HugeArraysAreRefusedInOneLine) {
  std::string text = R"({"version": 1, "camera": {"look_at": [0)";
  for (int i = 0; i < 1'000'000; ++i) text += ",0";
  EXPECT_THAT(refusal(text + "], \"position\": [0,0,0]}}"),
              AllOf(HasSubstr(": /camera/look_at: "), HasSubstr("a list of 1000001")));
}

TEST_F(SceneFileTest, ControlCharactersOfForeignTextAreNotPrinted) {
  const std::string message = refusal(R"({"version": 1, "\u001b[31mred\n": 1})");
  EXPECT_EQ(message.find('\x1b'), std::string::npos);
}

// ---- Files.

TEST_F(SceneFileTest, RefusesWhatIsNoRegularFileWithoutBlocking) {
  const auto fifo = folder_.path() / "pipe.json";
  ASSERT_EQ(mkfifo(fifo.c_str(), 0600), 0);
  EXPECT_THAT(message_of([&] { load_scene(fifo, {}); }), HasSubstr("not a regular file"));
  EXPECT_THAT(message_of([&] { load_scene(folder_.path(), {}); }), HasSubstr("this is a folder"));
  EXPECT_THAT(message_of([&] { load_scene("/dev/zero", {}); }), HasSubstr("not a regular file"));
  EXPECT_THAT(message_of([&] { load_scene(folder_.path() / "none.json", {}); }),
              HasSubstr("No such file"));
}

TEST_F(SceneFileTest, RefusesAssetsThatAreNoRegularFiles) {
  ASSERT_EQ(mkfifo((folder_.path() / "pipe.obj").c_str(), 0600), 0);
  const auto with_mesh = [](const std::string& file) {
    return R"({"version": 1, "meshes": [{"file": ")" + file + "\"}]}";
  };
  for (const char* file : {"pipe.obj", "/dev/zero", ".", "missing.obj"}) {
    const std::string message = message_of([&] { load(with_mesh(file)); });
    EXPECT_THAT(message, HasSubstr("scene.json: /meshes/0/file: ")) << file;
  }
  const std::string long_name(1 << 20, 'a');
  EXPECT_THAT(message_of([&] { load(with_mesh(long_name)); }),
              HasSubstr("/meshes/0/file: the path is "));
  EXPECT_THAT(message_of([&] {
                load(R"({"version": 1, "lights": [{"type": "environment", "file": "sky.exr"}]})");
              }),
              HasSubstr("/lights/0/file: "));
  EXPECT_THAT(
      message_of([&] { load(R"({"version": 1, "volumes": [{"type": "vdb", "file": "x.vdb"}]})"); }),
      HasSubstr("/volumes/0/file: "));
}

TEST_F(SceneFileTest, PathsAreRelativeToTheFileAndExpandTheEnvironment) {
  std::filesystem::create_directory(folder_.path() / "sub");
  write("sub/tri.obj", kTriangle);
  ::setenv("BRUME_TEST_SUB", "sub", 1);
  const Scene scene = load(R"({"version": 1, "materials": {"m": {}}, "meshes": [
    {"file": "${BRUME_TEST_SUB}/tri.obj", "material": "m"}]})");
  ::unsetenv("BRUME_TEST_SUB");
  ASSERT_EQ(scene.meshes.size(), 1u);
  EXPECT_EQ(scene.meshes[0].triangles.size(), 1u);
}

TEST_F(SceneFileTest, FrameNumbersFillRunsOfHashes) {
  SceneFileOptions options;
  options.load_data = false;
  options.frame = 17;
  const std::string text = R"({"version": 1, "volumes": [{"type": "vdb", "file": "s.####.vdb"}],
    "cache": {"file": "c.###.irc"}, "outputs": [{"file": "o#_######.exr"}]})";
  Scene scene = load(text, options);
  EXPECT_EQ(scene.volumes[0].name, "s.0017.vdb");
  EXPECT_EQ(scene.cache.file.filename(), "c.017.irc");
  EXPECT_EQ(scene.outputs[0].file.filename(), "o#_000017.exr");
  options.frame = -12345;
  EXPECT_EQ(load(text, options).volumes[0].name, "s.-12345.vdb");
}

TEST_F(SceneFileTest, CacheOfChangingInputNeedsAFrameNumber) {
  SceneFileOptions options;
  options.load_data = false;
  options.frame = 1;
  EXPECT_THAT(message_of([&] {
                load(R"({"version": 1, "volumes": [{"type": "vdb", "file": "s.####.vdb"}],
                         "cache": {"file": "c.irc"}})",
                     options);
              }),
              AllOf(HasSubstr(": /cache/file: "), HasSubstr("####")));
}

TEST_F(SceneFileTest, ConfinementRefusesWhatLeavesTheFolder) {
  const ScratchFolder outside;
  std::ofstream(outside.path() / "tri.obj") << kTriangle;
  std::filesystem::create_symlink(outside.path() / "tri.obj", folder_.path() / "link.obj");
  write("inside.obj", kTriangle);
  write("sneaky.obj",
        "mtllib ../" + outside.path().filename().string() + "/m.mtl\nusemtl m\n" + kTriangle);
  std::ofstream(outside.path() / "m.mtl") << "newmtl m\nKd 1 0 0\n";
  SceneFileOptions options;
  const auto load_mesh = [&](const std::string& file) {
    return load(R"({"version": 1, "meshes": [{"file": ")" + file + "\"}]}", options);
  };
  const std::string away = outside.path().string() + "/tri.obj";
  EXPECT_EQ(load_mesh(away).meshes.size(), 1u);  // A local scene may name any path.
  options.confine = folder_.path();
  EXPECT_EQ(load_mesh("inside.obj").meshes.size(), 1u);
  for (const std::string& file :
       {away, std::string("link.obj"), "../" + outside.path().filename().string() + "/tri.obj"})
    EXPECT_THAT(message_of([&] { load_mesh(file); }),
                AllOf(HasSubstr("/meshes/0/file: "), HasSubstr("leaves the folder")))
        << file;
  EXPECT_THAT(
      message_of([&] { load(R"({"version": 1, "outputs": [{"file": "/etc/x.exr"}]})", options); }),
      AllOf(HasSubstr("/outputs/0/file: "), HasSubstr("leaves the folder")));
  // What a mesh names is confined too: the library is not read, and that is said.
  const Scene scene = load_mesh("sneaky.obj");
  EXPECT_THAT(scene.warnings, testing::Contains(HasSubstr("leaves the folder")));
  EXPECT_EQ(scene.materials.back().albedo, Rgb(0.5f));
}

// ---- Volumes.

TEST_F(SceneFileTest, SceneTransformComesAfterTheGridsAndSharesTheData) {
  Affine3d own;
  own.m[0] = {0.5, 0, 0, 1};
  own.m[1] = {0, 0.5, 0, 2};
  own.m[2] = {0, 0, 0.5, 3};
  write_constant_grids(folder_.path() / "a.vdb", {"density"}, 4, 2, own);
  const Scene scene = load(R"({"version": 1, "volumes": [
    {"type": "vdb", "file": "a.vdb", "density_scale": 3},
    {"type": "vdb", "file": "a.vdb", "transform": [0,-2,0,10, 2,0,0,20, 0,0,2,30, 0,0,0,1]}]})");
  ASSERT_EQ(scene.volumes.size(), 2u);
  const BrickGrid &plain = *scene.volumes[0].density, &moved = *scene.volumes[1].density;
  EXPECT_EQ(plain.index_to_world().point({1, 1, 1}), Vec3d(1.5, 2.5, 3.5));
  // (1.5, 2.5, 3.5), turned a quarter about z, doubled, shifted.
  EXPECT_LT((moved.index_to_world().point({1, 1, 1}) - Vec3d(5, 23, 37)).length(), 1e-12);
  EXPECT_NEAR(moved.voxel_size(), 1, 1e-12);
  EXPECT_NEAR(scene.volumes[1].density_at({5, 23, 37}), 2, 1e-6);
  EXPECT_EQ(scene.grids.size(), 1u) << "the file is read once";
  for (std::size_t i = 0; i < plain.stored_brick_count(); ++i)
    EXPECT_EQ(plain.brick(std::int32_t(i)), moved.brick(std::int32_t(i)));
}

TEST_F(SceneFileTest, RefusesVoxelSizesWithoutMeaning) {
  write_constant_grids(folder_.path() / "a.vdb", {"density"}, 2, 1);
  for (const char* size : {"1e-6", "1e10"}) {
    const std::string text = std::string(R"({"version": 1, "volumes": [{"type": "vdb",
      "file": "a.vdb", "transform": [)") +
                             size + ",0,0,0, 0," + size + ",0,0, 0,0," + size + ",0, 0,0,0,1]}]}";
    EXPECT_THAT(message_of([&] { load(text); }),
                AllOf(HasSubstr("/volumes/0/transform: "), HasSubstr("outside 1e-5 .. 1e9")))
        << size;
  }
}

TEST_F(SceneFileTest, GridErrorsNameTheVolume) {
  write_constant_grids(folder_.path() / "a.vdb", {"density"}, 2, 1);
  const auto volume = [](const std::string& rest) {
    return R"({"version": 1, "volumes": [{"type": "vdb", "file": "a.vdb")" + rest + "}]}";
  };
  EXPECT_THAT(message_of([&] { load(volume(R"(, "grids": {"density": "smoke"})")); }),
              AllOf(HasSubstr("/volumes/0/file: "), HasSubstr("smoke")));
  EXPECT_THAT(message_of([&] { load(volume(R"(, "emission": {"mode": "blackbody"})")); }),
              HasSubstr("/volumes/0/file: "));
  EXPECT_THAT(message_of([&] { load(volume(R"(, "emission": {"mode": "grid"})")); }),
              AllOf(HasSubstr("/volumes/0/emission/mode: "), HasSubstr("neither an emission")));
  EXPECT_THAT(message_of([&] { load(volume(R"(, "grids": {"color": "Cd"})")); }),
              HasSubstr("/volumes/0/file: "));
  const Scene unused = load(volume(R"(, "grids": {"temperature": "density"})"));
  EXPECT_THAT(unused.warnings,
              testing::Contains(HasSubstr("/volumes/0/grids/temperature: not read")));
  write("broken.vdb", "not a volume");
  EXPECT_THAT(message_of([&] {
                load(R"({"version": 1, "volumes": [{"type": "vdb", "file": "broken.vdb"}]})");
              }),
              HasSubstr("scene.json: /volumes/0/file: "));
}

TEST_F(SceneFileTest, EmissionGridsAreFoundByRole) {
  write_constant_grids(folder_.path() / "fire.vdb", {"density", "flames", "temp"}, 2, 1);
  const Scene scene = load(R"({"version": 1, "volumes": [
    {"type": "vdb", "file": "fire.vdb", "emission": {"mode": "grid", "color": [1,0.5,0]}},
    {"type": "vdb", "file": "fire.vdb", "emission": {"mode": "blackbody", "temperature_scale": 9}},
    {"type": "vdb", "file": "fire.vdb", "grids": {"flame": "temp"}, "emission": {"mode": "grid"}},
    {"type": "vdb", "file": "fire.vdb", "emission": {"mode": "density", "scale": 2}}]})");
  EXPECT_EQ(scene.volumes[0].emission.grid.size(), 1u);
  EXPECT_EQ(scene.volumes[0].emission.color, Rgb(1, 0.5, 0));
  EXPECT_EQ(scene.volumes[1].emission.grid.size(), 1u);
  EXPECT_EQ(scene.volumes[2].emission.grid.size(), 1u);
  EXPECT_TRUE(scene.volumes[3].emission.grid.empty());
  EXPECT_EQ(scene.volumes[3].emission.scale, 2);
  EXPECT_THAT(scene.grids, testing::Contains("fire.vdb: flames as flame"));
  EXPECT_THAT(scene.grids, testing::Contains("fire.vdb: temp as temperature"));
}

// ---- Cameras.

TEST_F(SceneFileTest, CamerasAreFoundByName) {
  const std::string both = R"({"version": 1, "camera": {"position": [0,0,1], "look_at": [0,0,0]},
    "cameras": {"b": {"position": [0,0,2], "look_at": [0,0,0]},
                "a": {"position": [0,0,3], "look_at": [0,0,0]}}})";
  const Scene scene = check(both);
  EXPECT_EQ(scene.find_camera("").position.z, 1);
  EXPECT_EQ(scene.find_camera("b").position.z, 2);
  EXPECT_THAT(message_of([&] { scene.find_camera("c"); }), HasSubstr("a, b"));
  EXPECT_THAT(message_of([&] { scene.find_camera("c"); }), HasSubstr("scene.json: /cameras: "));
  const Scene named =
      check(R"({"version": 1, "cameras": {"z": {"position": [0,0,2], "look_at": [0,0,0]},
                                          "y": {"position": [0,0,3], "look_at": [0,0,0]}}})");
  EXPECT_EQ(named.find_camera("").position.z, 3);
  EXPECT_THAT(message_of([&] { check(R"({"version": 1})").find_camera(""); }),
              HasSubstr("no camera"));
}

}  // namespace
}  // namespace brume
