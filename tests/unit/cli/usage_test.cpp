// What is refused, with which exit code, hint and line.
#include <gmock/gmock.h>

#include "cli_fixture.h"

namespace brume {
namespace {

using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class Usage : public CliTest {
 protected:
  static void expect_one_error_line(const RunResult& result) {
    EXPECT_THAT(result.err, StartsWith("error: "));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
    EXPECT_EQ(result.out, "");
  }
};

TEST_F(Usage, WithoutAVerbNamesTheVerbs) {
  const RunResult result = brume({});
  EXPECT_EQ(result.code, 2);
  expect_one_error_line(result);
  for (const char* verb :
       {"render", "bake", "inspect", "verify", "probe", "diff", "filter", "convert", "scene"})
    EXPECT_THAT(result.err, HasSubstr(verb));
}

TEST_F(Usage, AnUnknownVerbHintsAtTheNearest) {
  const RunResult result = brume({"rendr", "a.json", "-o", "a.exr"});
  EXPECT_EQ(result.code, 2);
  expect_one_error_line(result);
  EXPECT_THAT(result.err, HasSubstr("did you mean 'render'?"));
}

TEST_F(Usage, AnUnknownFlagHintsAtTheNearest) {
  const RunResult result = brume({"render", "a.json", "--step-voxel=2"});
  EXPECT_EQ(result.code, 2);
  expect_one_error_line(result);
  EXPECT_THAT(result.err, HasSubstr("'--step-voxel'"));
  EXPECT_THAT(result.err, HasSubstr("did you mean '--step-voxels'?"));
}

TEST_F(Usage, HintsKnowGlobalFlagsAfterAVerb) {
  EXPECT_THAT(brume({"bake", "a.json", "--thread", "2"}).err,
              HasSubstr("did you mean '--threads'?"));
}

TEST_F(Usage, AFarNameGetsNoHint) {
  EXPECT_THAT(brume({"render", "a.json", "--zzzzzzzzzz"}).err, Not(HasSubstr("did you mean")));
}

TEST_F(Usage, AnUnknownInnerVerbIsRefused) {
  const RunResult result = brume({"scene", "chek", "a.json"});
  EXPECT_EQ(result.code, 2);
  expect_one_error_line(result);
}

struct BadCommand {
  std::vector<std::string> arguments;
  const char* names;  // What the message has to name.
};

class BadCommands : public Usage, public testing::WithParamInterface<BadCommand> {};

TEST_P(BadCommands, AreUsageErrorsThatNameTheOption) {
  const RunResult result = brume(GetParam().arguments);
  EXPECT_EQ(result.code, 2) << result.err;
  expect_one_error_line(result);
  EXPECT_THAT(result.err, HasSubstr(GetParam().names));
}

INSTANTIATE_TEST_SUITE_P(
    EachOption, BadCommands,
    testing::Values(
        BadCommand{{"render"}, "SCENE"}, BadCommand{{"verify", "c.irc"}, "SCENE"},
        BadCommand{{"probe", "a.json", "--at", "0,0,0"}, "--normal"},
        BadCommand{{"render", "a.json", "--res", "12"}, "--res"},
        BadCommand{{"render", "a.json", "--res", "0x4"}, "--res"},
        BadCommand{{"render", "a.json", "--res", "99999999x4"}, "--res"},
        BadCommand{{"render", "a.json", "--res-scale", "nan"}, "--res-scale"},
        BadCommand{{"render", "a.json", "--res-scale", "-1"}, "--res-scale"},
        BadCommand{{"render", "a.json", "--crop", "3,0,1,4"}, "--crop"},
        BadCommand{{"render", "a.json", "--crop", "0.0,0,2,1"}, "--crop"},
        BadCommand{{"render", "a.json", "--pixel", "1"}, "--pixel"},
        BadCommand{{"render", "a.json", "--pixel", "-1,2"}, "--pixel"},
        BadCommand{{"render", "a.json", "--cells", "8"}, "--cells"},
        BadCommand{{"render", "a.json", "--cells", "8x0"}, "--cells"},
        BadCommand{{"render", "a.json", "--seed", "-1"}, "--seed"},
        BadCommand{{"render", "a.json", "--seed", "1.5"}, "--seed"},
        BadCommand{{"render", "a.json", "--bounces", "251"}, "--bounces"},
        BadCommand{{"render", "a.json", "--volume-bounces", "some"}, "--volume-bounces"},
        BadCommand{{"render", "a.json", "--error", "0"}, "--error"},
        BadCommand{{"render", "a.json", "--gradient", "fully"}, "ward-heckbert"},
        BadCommand{{"render", "a.json", "--preset", "best"}, "draft, normal, high, reference"},
        BadCommand{{"render", "a.json", "--memory-limit", "4Q"}, "--memory-limit"},
        BadCommand{{"render", "a.json", "--spp", "0"}, "--spp"},
        BadCommand{{"render", "a.json", "--spp", "16x"}, "--spp"},
        BadCommand{{"render", "a.json", "-o", "a.exr", "--noise", "0.1"}, "--noise"},
        BadCommand{{"render", "a.json", "-o", "a.exr", "--transport", "cached"}, "--transport"},
        BadCommand{{"render", "a.json", "-o", "a.exr", "--integrator", "path", "--cache", "c.irc"},
                   "--cache"},
        BadCommand{{"render", "a.json", "-o", "a.png"}, "--preview"},
        BadCommand{{"render", "a.json", "-o", "a.exr", "--preview", "a.jpg"}, "--preview"},
        BadCommand{{"render", "a.json", "-o", "a.exr", "--preview-layer", "Z"}, "--preview"},
        BadCommand{{"render", "a.json", "--pixel", "1,1", "-o", "a.exr"}, "--pixel"},
        BadCommand{{"render", "a.json", "--threads", "-2"}, "--threads"},
        BadCommand{{"render", "a.json", "extra.json"}, "extra.json"},
        BadCommand{{"bake", "a.json", "--cache-mode", "old"}, "--cache-mode"},
        BadCommand{{"bake", "a.json", "--everywhere", "--views", "left"}, "--everywhere"},
        BadCommand{{"probe", "a.json", "--at", "0,0", "--normal", "0,1,0"}, "--at"},
        BadCommand{{"probe", "a.json", "--at", "0,inf,0", "--normal", "0,1,0"}, "--at"},
        BadCommand{{"probe", "a.json", "--at", "0,0,0", "--normal", "0,0,0"}, "--normal"},
        BadCommand{{"verify", "c.irc", "a.json", "--points", "0"}, "--points"},
        BadCommand{{"help", "rendr"}, "did you mean 'render'"}));

TEST_F(Usage, WithoutAnOutputSaysHowToNameOne) {
  const RunResult result = brume({"render", write_scene()});
  EXPECT_EQ(result.code, 2);
  EXPECT_THAT(result.err, HasSubstr("-o OUT.exr"));
}

TEST_F(Usage, WithoutACacheFileBakeSaysHowToNameOne) {
  const RunResult result = brume({"bake", write_scene()});
  EXPECT_EQ(result.code, 2);
  EXPECT_THAT(result.err, HasSubstr("-o C.irc"));
}

TEST_F(Usage, AnUnknownLayerIsRefusedBeforeAnyWork) {
  const RunResult result =
      brume({"render", write_scene(), "-o", path("a.exr"), "--aovs", "beauty,difuse_direct"});
  EXPECT_EQ(result.code, 2);
  EXPECT_THAT(result.err, HasSubstr("difuse_direct"));
  EXPECT_FALSE(exists("a.exr"));
}

TEST_F(Usage, AnUnknownCameraListsThoseThereAre) {
  const RunResult result =
      brume({"render", write_scene(), "-o", path("a.exr"), "--camera", "left"});
  EXPECT_EQ(result.code, 3);
  EXPECT_THAT(result.err, HasSubstr("left"));
}

TEST_F(Usage, HelpOfEveryVerbHasAnExample) {
  for (const char* verb :
       {"render", "bake", "inspect", "verify", "probe", "diff", "filter", "convert", "figures"}) {
    const RunResult result = brume({verb, "--help"});
    EXPECT_EQ(result.code, 0) << verb;
    EXPECT_EQ(result.err, "") << verb;
    EXPECT_THAT(result.out, HasSubstr(std::string("\n  brume ") + verb)) << verb;
  }
}

TEST_F(Usage, VersionNamesTheLibraries) {
  const RunResult result = brume({"--version"});
  EXPECT_EQ(result.code, 0);
  EXPECT_THAT(result.out, StartsWith("brume "));
  for (const char* library : {"OpenVDB 1", "Embree ", "OpenEXR 3", "OpenImageIO 2", "TBB 20",
                              "assimp 5", "CLI11 2", "json 3"})
    EXPECT_THAT(result.out, HasSubstr(library));
}

TEST_F(Usage, TheManualIsWhatTheProgramSays) {
  std::ifstream file(BRUME_SOURCE_DIR "/docs/cli.md");
  std::ostringstream manual;
  manual << file.rdbuf();
  EXPECT_EQ(manual.str(), brume({"help", "--markdown"}).out)
      << "write it anew: brume help --markdown > docs/cli.md";
}

}  // namespace
}  // namespace brume
