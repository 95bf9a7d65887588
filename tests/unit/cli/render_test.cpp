// brume render: files, precedence, statistics, and what stops it before any work.
#include <gmock/gmock.h>

#include "cli_fixture.h"
#include "core/image.h"

namespace brume {
namespace {

using testing::HasSubstr;
using testing::Not;

class Render : public CliTest {
 protected:
  RunResult render(std::vector<std::string> more) {
    std::vector<std::string> arguments{"render", write_scene(), "-o", path("a.exr"), "--spp", "1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return brume(arguments);
  }
};

TEST_F(Render, WritesAnImageWithItsProvenance) {
  const RunResult result = render({"--json", "--preview", path("a.png")});
  ASSERT_EQ(result.code, 0) << result.err;
  const ImageFile file = read_image(path("a.exr"));
  EXPECT_EQ(file.image.width, 16);
  EXPECT_EQ(file.image.height, 12);
  EXPECT_NE(file.image.find("diffuse_indirect.R"), nullptr);
  EXPECT_NE(file.image.find("Z"), nullptr);
  for (const char* key : {"software", "command", "brume:sceneHash", "brume:cacheHash",
                          "worldToCamera", "brume:seconds:render", "brume:peakBytes", "brume:grids",
                          "brume:effects", "brume:badVoxels", "brume:nanPixels"})
    EXPECT_TRUE(file.metadata.contains(key)) << key;
  EXPECT_TRUE(exists("a.png"));
  double sum = 0;
  for (const Rgb& c : file.image.layer("diffuse_indirect")) sum += luminance(c);
  EXPECT_GT(sum, 0);
}

TEST_F(Render, JsonHasTheKeysThatScriptsRelyOn) {
  const auto json = render({"--json"}).json();
  ASSERT_TRUE(json.is_object());
  for (const char* key :
       {"seconds", "rays", "segments", "records", "peak_bytes", "effects", "medium_shadow_rays",
        "fallback_gathers", "cache_clamps", "bad_pixels", "samples", "light_volume_rms_error"})
    EXPECT_TRUE(json.contains(key)) << key;
  for (const char* stage : {"load", "world", "lighting", "bake", "render", "write", "total"})
    EXPECT_TRUE(json["seconds"].contains(stage)) << stage;
  EXPECT_GT(json["rays"], 0);
  EXPECT_GT(json["records"], 0);
  EXPECT_GT(json["peak_bytes"], 1 << 20);
}

TEST_F(Render, AVacuumMarchesNothing) {
  write_scene("vacuum.json", "", "");
  const RunResult result =
      brume({"render", path("vacuum.json"), "-o", path("v.exr"), "--spp", "1", "--json"});
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = result.json();
  EXPECT_EQ(json["segments"], 0);
  EXPECT_EQ(json["march_rays"], 0);
  EXPECT_EQ(json["medium_shadow_rays"], 0);
  EXPECT_EQ(json["light_volume_lookups"], 0);
}

TEST_F(Render, WithoutScatteringNoLightIsTracedInTheMedium) {
  const auto json = render({"--json", "--volume-bounces", "0"}).json();
  EXPECT_EQ(json["medium_shadow_rays"], 0);
  EXPECT_GT(json["march_rays"], 0);
}

TEST_F(Render, StatsHoldWhatJsonHolds) {
  const RunResult result = render({"--json", "--stats", path("stats.json")});
  ASSERT_EQ(result.code, 0) << result.err;
  const auto stats = nlohmann::json::parse(read("stats.json"), nullptr, false);
  ASSERT_TRUE(stats.is_object());
  EXPECT_EQ(stats["records"], result.json()["records"]);
  EXPECT_EQ(stats["rays"], result.json()["rays"]);
}

TEST_F(Render, ReproducibleImagesDependOnNoThreadCountOrName) {
  const std::string scene = write_scene();
  for (const char* name : {"1", "2", "3"}) {
    const RunResult result =
        brume({"-t", name, "render", scene, "-o", path(std::string(name) + ".exr"), "--spp", "1",
               "--reproducible"});
    ASSERT_EQ(result.code, 0) << result.err;
  }
  EXPECT_TRUE(read("1.exr") == read("2.exr"));
  EXPECT_TRUE(read("1.exr") == read("3.exr"));
  const ImageFile file = read_image(path("1.exr"));
  EXPECT_FALSE(file.metadata.contains("brume:seconds:render"));
  EXPECT_TRUE(file.metadata.contains("brume:sceneHash"));
}

TEST_F(Render, GlobalOptionsGoBeforeOrAfterTheVerb) {
  const std::string scene = write_scene();
  const RunResult before =
      brume({"--json", "-q", "render", scene, "-o", path("a.exr"), "--spp", "1"});
  const RunResult after =
      brume({"render", scene, "-o", path("a.exr"), "--spp", "1", "--json", "-q"});
  for (const RunResult& result : {before, after}) {
    EXPECT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(result.err, "");
    EXPECT_TRUE(result.json().is_object());
  }
}

TEST_F(Render, AFlagWinsOverTheEnvironmentAndThatOverTheScene) {
  const auto shells = [&](std::vector<std::string> more) { return render(more).json()["samples"]; };
  const std::string scene = write_scene();
  {
    const ScopedVariable variable("BRUME_SPP", "3");
    EXPECT_EQ(brume({"render", scene, "-o", path("a.exr"), "--json"}).json()["samples"], 3);
    EXPECT_EQ(shells({"--json"}), 1);
  }
  // The scene file says one bounce: none leaves nothing for records to hold but the medium's light.
  const auto with_one = render({"--json"}).json();
  const ScopedVariable variable("BRUME_BOUNCES", "0");
  EXPECT_NE(render({"--json"}).json()["records"], with_one["records"]);
  EXPECT_EQ(render({"--json", "--bounces", "1"}).json()["records"], with_one["records"]);
}

TEST_F(Render, ABadVariableIsNamed) {
  const ScopedVariable variable("BRUME_CELLS", "many");
  const RunResult result = render({});
  EXPECT_EQ(result.code, 2);
  EXPECT_THAT(result.err, HasSubstr("BRUME_CELLS"));
  EXPECT_EQ(brume({"inspect", path("missing.vdb")}).code, 3) << "inspect has no cells";
}

TEST_F(Render, AnUnknownVariableIsWarnedOfWithAHint) {
  const ScopedVariable variable("BRUME_SEDE", "4");
  const RunResult result = brume({"scene", "schema"});
  EXPECT_EQ(result.code, 0);
  EXPECT_THAT(result.err, HasSubstr("BRUME_SEDE"));
  EXPECT_THAT(result.err, HasSubstr("BRUME_SEED"));
}

TEST_F(Render, ExistingImagesFollowThePolicy) {
  write("a.exr", "precious");
  EXPECT_EQ(render({"--existing", "error"}).code, 6);
  EXPECT_EQ(read("a.exr"), "precious");
  const RunResult skipped = render({"--existing", "skip"});
  EXPECT_EQ(skipped.code, 0);
  EXPECT_THAT(skipped.err, HasSubstr("skipped"));
  EXPECT_EQ(read("a.exr"), "precious");
  EXPECT_EQ(render({"--existing", "overwrite"}).code, 0);
  EXPECT_TRUE(read("a.exr") != "precious");
}

TEST_F(Render, UnwritableOutputsAreFoundBeforeWorkBegins) {
  std::filesystem::create_directories(folder_ / "folder.exr");
  std::filesystem::create_symlink("loop.exr", folder_ / "loop.exr");
  write("file", "");
  const std::string scene = write_scene();
  for (const char* name : {"folder.exr", "loop.exr", "missing/a.exr", "file/a.exr"}) {
    const RunResult result = brume({"render", scene, "-o", path(name), "-v"});
    EXPECT_EQ(result.code, 6) << name << ": " << result.err;
    EXPECT_THAT(result.err, HasSubstr(name));
  }
  EXPECT_EQ(render({"--stats", path("missing/s.json")}).code, 6);
  EXPECT_EQ(render({"--cache", path("missing/c.irc")}).code, 6);
  EXPECT_EQ(render({"--preview", path("missing/p.png")}).code, 6);
  EXPECT_FALSE(exists("a.exr"));
}

TEST_F(Render, OutputsComeFromTheSceneWhereNoneIsNamed) {
  const std::string scene =
      write_scene("room.json",
                  R"("outputs": [{"file": "b.exr", "aovs": ["beauty", "Z"]}, {"file": "c.exr"}],)");
  const RunResult result = brume({"render", scene, "--spp", "1"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(read_image(path("b.exr")).image.find("albedo.R"), nullptr);
  EXPECT_NE(read_image(path("b.exr")).image.find("Z"), nullptr);
  EXPECT_NE(read_image(path("c.exr")).image.find("albedo.R"), nullptr);
}

TEST_F(Render, OnlyTheCropIsRendered) {
  ASSERT_EQ(render({"--crop", "2,3,5,7", "--aovs", "cost"}).code, 0);
  const ImageFile file = read_image(path("a.exr"));
  const auto* cost = file.image.find("cost");
  ASSERT_NE(cost, nullptr);
  for (int y = 0; y < 12; ++y)
    for (int x = 0; x < 16; ++x)
      EXPECT_EQ(cost->values[y * 16 + x] > 0, x >= 2 && x < 5 && y >= 3 && y < 7) << x << ',' << y;
  EXPECT_EQ(render({"--crop", "0,0,17,2"}).code, 2);
}

TEST_F(Render, ThePathTracersCropIsTheSame) {
  ASSERT_EQ(render({"--integrator", "path", "--crop", "2,3,5,7", "--aovs", "cost"}).code, 0);
  const ImageFile file = read_image(path("a.exr"));
  const auto* cost = file.image.find("cost");
  ASSERT_NE(cost, nullptr);
  for (int y = 0; y < 12; ++y)
    for (int x = 0; x < 16; ++x)
      EXPECT_EQ(cost->values[y * 16 + x] > 0, x >= 2 && x < 5 && y >= 3 && y < 7) << x << ',' << y;
}

TEST_F(Render, ResolutionIsScaledAndLimited) {
  ASSERT_EQ(render({"--res", "20x10", "--res-scale", "0.5"}).code, 0);
  EXPECT_EQ(read_image(path("a.exr")).image.width, 10);
  const RunResult result = render({"--res", "40x40", "--max-image-pixels", "1000"});
  EXPECT_EQ(result.code, 3);
  EXPECT_THAT(result.err, HasSubstr("--max-image-pixels"));
}

TEST_F(Render, APixelIsExplained) {
  const std::string scene = write_scene();
  const RunResult text = brume({"render", scene, "--pixel", "8,6", "--spp", "1"});
  EXPECT_EQ(text.code, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr("diffuse_indirect"));
  const RunResult result = brume({"render", scene, "--pixel", "8,6", "--spp", "1", "--json"});
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = result.json();
  EXPECT_TRUE(json["layers"].contains("volume_direct"));
  EXPECT_EQ(json["hit"]["material"], "white");
  ASSERT_FALSE(json["records"].empty());
  double shares = 0;
  for (const auto& record : json["records"]) shares += double(record["share"]);
  EXPECT_NEAR(shares, 1, 1e-9);
}

TEST_F(Render, PathTracingReportsItsErrorAndNeedsNoCache) {
  const RunResult result =
      render({"--integrator", "path", "--transport", "cached", "--spp", "4", "--json"});
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = result.json();
  EXPECT_EQ(json["samples"], 4);
  EXPECT_GT(json["estimated_error"], 0);
  EXPECT_EQ(json["records"], 0);
}

TEST_F(Render, OverridesReachTheScene) {
  const auto json = render({"--json", "-D", "/film/resolution/0=8"}).json();
  EXPECT_EQ(json["pixels"], 8 * 12);
  const RunResult bad = render({"-D", "/film/resolutions=8"});
  EXPECT_EQ(bad.code, 3);
  EXPECT_THAT(bad.err, HasSubstr("/film/resolutions"));
}

class BadScenes : public CliTest {};

TEST_F(BadScenes, AreRefusedInOneLineThatNamesThem) {
  const std::filesystem::path malformed = std::filesystem::path(BRUME_SHARED_DATA) / "malformed";
  if (!std::filesystem::exists(malformed)) GTEST_SKIP() << malformed << " is absent";
  for (const char* name : {"lfs_pointer.vdb", "teapot_cloud_is_nanovdb.vdb"}) {
    const std::string file = (malformed / name).string();
    for (const auto& arguments :
         {std::vector<std::string>{"render", file, "-o", path("a.exr")}, {"inspect", file}}) {
      const RunResult result = brume(arguments);
      EXPECT_EQ(result.code, 3) << name;
      EXPECT_THAT(result.err, HasSubstr(name));
      EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    }
  }
  EXPECT_EQ(brume({"render", path("none.json"), "-o", path("a.exr")}).code, 3);
  write("broken.json", "{\"version\": 1,");
  EXPECT_EQ(brume({"render", path("broken.json"), "-o", path("a.exr")}).code, 3);
  EXPECT_EQ(brume({"render", folder_.string(), "-o", path("a.exr")}).code, 3);
}

TEST_F(BadScenes, AnEmptyGridRendersAsVacuumWithAWarning) {
  const auto file = std::filesystem::path(BRUME_SHARED_DATA) / "malformed" / "all_zero_density.vdb";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is absent";
  const RunResult shown = brume({"inspect", file.string(), "--json"});
  EXPECT_EQ(shown.code, 0) << shown.err;
  EXPECT_EQ(shown.json()["grids"].size(), 1u);
  const RunResult rendered =
      brume({"render", file.string(), "-o", path("a.exr"), "--res", "8x8", "--spp", "1", "--json"});
  EXPECT_EQ(rendered.code, 0) << rendered.err;
  EXPECT_THAT(rendered.err, HasSubstr("is 0 everywhere: taken as vacuum"));
  EXPECT_EQ(rendered.json()["segments"], 0);
  EXPECT_TRUE(exists("a.exr"));
}

TEST_F(BadScenes, GridsAreInspected) {
  const auto file = std::filesystem::path(BRUME_SHARED_DATA) / "vdb" / "smoke1.vdb";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is absent";
  const RunResult text = brume({"inspect", file.string()});
  EXPECT_EQ(text.code, 0) << text.err;
  EXPECT_THAT(text.out, HasSubstr("density"));
  const auto json = brume({"inspect", file.string(), "--json"}).json();
  ASSERT_FALSE(json["grids"].empty());
  EXPECT_EQ(json["grids"][0]["role"], "density");
  EXPECT_GT(json["grids"][0]["proposed_density_scale"], 0);
}

}  // namespace
}  // namespace brume
