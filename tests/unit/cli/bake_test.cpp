// brume bake and verify: SPEC's cache states and modes.
#include <gmock/gmock.h>

#include "cli_fixture.h"

namespace brume {
namespace {

using testing::HasSubstr;

class Bake : public CliTest {
 protected:
  RunResult bake(std::vector<std::string> more = {}) {
    std::vector<std::string> arguments{"bake", write_scene(), "-o", path("c.irc"), "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return brume(arguments);
  }
  RunResult render(std::vector<std::string> more) {
    std::vector<std::string> arguments{"render",      write_scene(), "-o", path("a.exr"), "--cache",
                                       path("c.irc"), "--spp",       "1",  "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return brume(arguments);
  }
};

TEST_F(Bake, AMissingCacheIsBaked) {
  const RunResult result = bake();
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = result.json();
  EXPECT_GT(json["records"], 0);
  EXPECT_EQ(json["records"], json["records_added"]);
  EXPECT_EQ(json["written"], true);
  for (const char* key : {"seconds", "rays", "segments", "records", "peak_bytes", "effects"})
    EXPECT_TRUE(json.contains(key)) << key;
  EXPECT_TRUE(exists("c.irc"));
}

TEST_F(Bake, TheBytesDependOnNoThreadCount) {
  const std::string scene = write_scene();
  for (const char* threads : {"1", "2", "3"})
    ASSERT_EQ(brume({"bake", scene, "-o", path(threads), "-t", threads}).code, 0);
  EXPECT_TRUE(read("1") == read("2"));
  EXPECT_TRUE(read("1") == read("3"));
}

TEST_F(Bake, ACoveredCacheIsLeftAsItIs) {
  ASSERT_EQ(bake().code, 0);
  const auto before = std::filesystem::last_write_time(path("c.irc"));
  const RunResult result = bake();
  EXPECT_EQ(result.code, 0);
  EXPECT_EQ(result.json()["records_added"], 0);
  EXPECT_EQ(result.json()["written"], false);
  EXPECT_THAT(result.err, HasSubstr("left as it is"));
  EXPECT_EQ(std::filesystem::last_write_time(path("c.irc")), before);
}

TEST_F(Bake, AStaleCacheIsRefusedUnlessItIsToBeReplaced) {
  ASSERT_EQ(bake().code, 0);
  const std::string before = read("c.irc");
  for (const char* mode : {"append", "missing", "read"}) {
    const RunResult result = bake({"--seed", "7", "--cache-mode", mode});
    EXPECT_EQ(result.code, 3) << mode;
    EXPECT_THAT(result.err, HasSubstr("stale"));
    EXPECT_THAT(result.err, HasSubstr("seed 1, here 7"));
    EXPECT_TRUE(read("c.irc") == before);
  }
  EXPECT_EQ(bake({"-D", "/lights/0/intensity/0=4"}).code, 3);
  EXPECT_EQ(bake({"-D", "/camera/fov_deg=50"}).code, 0) << "cameras are not part of it";
  EXPECT_EQ(bake({"--seed", "7", "--cache-mode", "new"}).code, 0);
  EXPECT_TRUE(read("c.irc") != before);
}

TEST_F(Bake, ARenamedCacheIsAsGoodAsBefore) {
  ASSERT_EQ(bake().code, 0);
  std::filesystem::rename(path("c.irc"), path("d.irc"));
  const RunResult result = brume({"bake", write_scene(), "-o", path("d.irc"), "--json"});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(result.json()["written"], false);
}

TEST_F(Bake, DamagedAndForeignFilesAreRefusedUntouched) {
  ASSERT_EQ(bake().code, 0);
  std::string damaged = read("c.irc");
  damaged[damaged.size() / 2] = static_cast<char>(damaged[damaged.size() / 2] ^ 4);
  write("c.irc", damaged);
  RunResult result = bake();
  EXPECT_EQ(result.code, 3);
  EXPECT_THAT(result.err, HasSubstr("corrupt"));
  EXPECT_TRUE(read("c.irc") == damaged);
  EXPECT_EQ(render({}).code, 3);

  write("c.irc", "not a cache at all, but somebody's notes");
  result = bake();
  EXPECT_EQ(result.code, 3);
  EXPECT_THAT(result.err, HasSubstr("foreign"));
  EXPECT_EQ(read("c.irc"), "not a cache at all, but somebody's notes");
  EXPECT_EQ(bake({"--cache-mode", "new"}).code, 0);
  EXPECT_EQ(bake({"--cache-mode", "read"}).code, 0);
}

TEST_F(Bake, ReadModeSaysHowMuchIsNotCovered) {
  EXPECT_EQ(bake({"--cache-mode", "read"}).code, 3) << "a missing file";
  ASSERT_EQ(bake().code, 0);
  EXPECT_EQ(bake({"--cache-mode", "read"}).code, 0);
  const std::string before = read("c.irc");
  const RunResult result = bake({"--cache-mode", "read", "-D", "/camera/look_at=[0,1,5]"});
  EXPECT_EQ(result.code, 3);
  EXPECT_THAT(result.err, HasSubstr("are not covered"));
  EXPECT_TRUE(read("c.irc") == before);
}

TEST_F(Bake, AppendKeepsWhatWasThere) {
  const int first = bake().json()["records"];
  const RunResult result = bake({"--cache-mode", "append", "-D", "/camera/look_at=[0,1,5]"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_GT(result.json()["records_added"], 0);
  EXPECT_EQ(int(result.json()["records"]), first + int(result.json()["records_added"]));
}

TEST_F(Bake, RenderFillsReadsAndCountsFallbacks) {
  const RunResult filled = render({});
  ASSERT_EQ(filled.code, 0) << filled.err;
  EXPECT_TRUE(exists("c.irc"));
  EXPECT_GT(filled.json()["records_added"], 0);
  const std::string before = read("c.irc");
  const RunResult again = render({});
  EXPECT_EQ(again.json()["records_added"], 0);
  EXPECT_TRUE(read("c.irc") == before);
  const RunResult elsewhere = render({"--cache-mode", "read", "-D", "/camera/look_at=[0,1,5]"});
  ASSERT_EQ(elsewhere.code, 0) << elsewhere.err;
  EXPECT_GT(elsewhere.json()["fallback_gathers"], 0);
  EXPECT_TRUE(read("c.irc") == before);
}

TEST_F(Bake, TheSceneNamesACacheAndItsMode) {
  const std::string scene =
      write_scene("room.json", R"("cache": {"file": "own.irc", "mode": "read"},)");
  EXPECT_EQ(brume({"bake", scene}).code, 3);
  EXPECT_EQ(brume({"bake", scene, "--cache-mode", "missing"}).code, 0);
  EXPECT_TRUE(exists("own.irc"));
  EXPECT_EQ(brume({"bake", scene}).code, 0);
}

TEST_F(Bake, AnUnwritableCacheIsFoundBeforeWorkBegins) {
  const RunResult result = brume({"bake", path("none.json"), "-o", path("missing/c.irc")});
  EXPECT_EQ(result.code, 6) << result.err;
}

TEST_F(Bake, EverywhereCoversWhatNoCameraSees) {
  const RunResult result =
      brume({"bake", write_scene(), "-o", path("c.irc"), "--everywhere", "--json"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(bake({"--cache-mode", "read", "-D", "/camera/look_at=[0,1,5]"}).code, 0);
}

TEST_F(Bake, ABakeAndARenderCheckTheirAnswers) {
  const RunResult baked = bake({"--verify", "32"});
  ASSERT_EQ(baked.code, 0) << baked.err;
  EXPECT_THAT(baked.err, HasSubstr("verified at 32 points: bias "));
  const auto check = baked.json()["verification"];
  EXPECT_EQ(check["points"], 32);
  EXPECT_GT(check["truth"], 0);
  const RunResult inspected = brume({"inspect", path("c.irc"), "--json"});
  EXPECT_EQ(inspected.json()["verification"], check);
  const RunResult rendered = render({"--cache-mode", "read"});
  ASSERT_EQ(rendered.code, 0) << rendered.err;
  EXPECT_EQ(rendered.json()["verification"]["points"], 64);
  EXPECT_THAT(read("a.exr"), HasSubstr("brume:rmse"));
  const RunResult unchecked = render({"--verify", "0"});
  EXPECT_EQ(unchecked.code, 0);
  EXPECT_FALSE(unchecked.json().contains("verification"));
}

TEST_F(Bake, AnswersWorseThanTheThresholdFailOnceAllIsWritten) {
  const std::vector<std::string> coarse{"--cells", "1x2", "--error", "8", "--max-rmse", "1e-6"};
  const RunResult baked = bake(coarse);
  EXPECT_EQ(baked.code, 5);
  EXPECT_THAT(baked.err, HasSubstr("is above --max-rmse 1e-06"));
  EXPECT_TRUE(exists("c.irc"));
  std::vector<std::string> read_mode = coarse;
  read_mode.insert(read_mode.end(), {"--cache-mode", "read"});
  EXPECT_EQ(render(read_mode).code, 5);
  EXPECT_TRUE(exists("a.exr"));
  // Also where there is nothing to bake.
  EXPECT_EQ(bake(coarse).code, 5);
  EXPECT_EQ(bake({"--max-rmse", "1", "--verify", "0"}).code, 2);
  EXPECT_EQ(bake({"--max-rmse", "1", "--deep-only"}).code, 2);
  EXPECT_EQ(render({"--max-rmse", "1", "--gather-everywhere"}).code, 2);
}

TEST_F(Bake, VerifyFailsAboveItsThreshold) {
  ASSERT_EQ(bake().code, 0);
  const std::string scene = write_scene();
  const std::vector<std::string> base{"verify", path("c.irc"), scene, "--points",
                                      "8",      "--paths",     "400", "--json"};
  const RunResult result = brume(base);
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = result.json();
  for (const char* key : {"points", "bias", "rmse", "p95", "worst"})
    EXPECT_TRUE(json.contains(key)) << key;
  EXPECT_EQ(json["points"], 8);
  EXPECT_TRUE(json["worst"].is_object());
  auto strict = base;
  strict.insert(strict.end(), {"--max-rmse", "0"});
  const RunResult failed = brume(strict);
  EXPECT_EQ(failed.code, 5);
  EXPECT_THAT(failed.err, HasSubstr("rmse"));
  EXPECT_TRUE(failed.json().is_object()) << "the numbers are printed all the same";
}

TEST_F(Bake, VerifyMeasuresRecordsAgainstTheirOwnTruth) {
  ASSERT_EQ(bake({"--verify", "0"}).code, 0);
  const std::vector<std::string> base{"verify",    path("c.irc"), write_scene(),
                                      "--records", "6",           "--json"};
  const RunResult result = brume(base);
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = result.json();
  EXPECT_EQ(json["records"], 6);
  EXPECT_GT(json["calibration"], 0);
  EXPECT_GE(json["worst"], json["median"]);
  auto both = base;
  both.insert(both.end(), {"--max-rmse", "1"});
  EXPECT_EQ(brume(both).code, 2);
}

TEST_F(Bake, VerifyNamesTheWorstPointsAndSavesItsResult) {
  ASSERT_EQ(bake().code, 0);
  const std::vector<std::string> command{
      "verify",  path("c.irc"), write_scene(), "--points", "12",         "--paths", "400",
      "--worst", "4",           "--save",      "--json",   "--max-rmse", "0"};
  const RunResult result = brume(command);
  EXPECT_EQ(result.code, 5) << "saved all the same";
  const auto worst = result.json()["worst_points"];
  ASSERT_EQ(worst.size(), 4u);
  EXPECT_EQ(result.json()["worst"], worst[0]);
  for (std::size_t i = 1; i < 4; ++i)
    EXPECT_LE(std::abs(double(worst[i]["relative_error"])),
              std::abs(double(worst[i - 1]["relative_error"])));
  const std::string first = read("c.irc.verify.json");
  const auto saved = nlohmann::json::parse(first, nullptr, false);
  ASSERT_TRUE(saved.is_object());
  EXPECT_EQ(saved["rmse"], result.json()["rmse"]);
  EXPECT_EQ(saved["passed"], false);
  EXPECT_EQ(saved["fingerprint"],
            brume({"inspect", path("c.irc"), "--json"}).json()["fingerprint"]);
  EXPECT_EQ(brume(command).code, 5);
  EXPECT_EQ(read("c.irc.verify.json"), first) << "the same again";
}

TEST_F(Bake, VerifyRefusesACacheOfAnotherScene) {
  ASSERT_EQ(bake().code, 0);
  EXPECT_EQ(brume({"verify", path("c.irc"), write_scene(), "-D", "/lights/0/intensity/0=4"}).code,
            3);
  EXPECT_EQ(brume({"verify", path("none.irc"), write_scene()}).code, 3);
}

}  // namespace
}  // namespace brume
