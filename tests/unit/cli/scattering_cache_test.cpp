// Caches with records of the medium: what a bake goes through leaves the same bytes.
#include <gmock/gmock.h>

#include "cli_fixture.h"

namespace brume {
namespace {

using testing::HasSubstr;

constexpr const char* kSmoke =
    R"({"type": "homogeneous", "bounds": [[-0.6, 0.2, -0.6], [0.6, 1.4, 0.6]],
        "sigma_s": [1.5, 1.3, 1.1], "sigma_a": [0.1, 0.1, 0.1], "anisotropy": 0.3})";

class ScatteringCache : public CliTest {
 protected:
  std::vector<std::string> arguments(const std::string& verb, const std::string& output,
                                     const std::vector<std::string>& more) const {
    std::vector<std::string> all{verb,       write_scene("smoke.json", "", kSmoke),
                                 "-o",       path(output),
                                 "--json",   "--bounces",
                                 "3",        "--volume-bounces",
                                 "1000000",  "--progress",
                                 "none"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  RunResult bake(const std::string& name, const std::vector<std::string>& more = {}) {
    return brume(arguments("bake", name, more));
  }
  // The whole cache, baked once.
  std::string whole() {
    const RunResult result = bake("whole.irc", {"-t", "2"});
    EXPECT_EQ(result.code, 0) << result.err;
    return read("whole.irc");
  }
};

TEST_F(ScatteringCache, HoldsBothKindsAndTellsOfTheSolve) {
  whole();
  const auto json = brume({"inspect", path("whole.irc"), "--json"}).json();
  EXPECT_GT(int(json["records"]["surface"]), 100);
  EXPECT_GT(int(json["records"]["volume"]), 100);
  EXPECT_EQ(json["record_count"],
            int(json["records"]["surface"]) + int(json["records"]["volume"]));
  EXPECT_EQ(json["volume_order"], 1);
  EXPECT_EQ(json["solve"]["orders"], 2);
  EXPECT_EQ(json["solve"]["changes"].size(), 2u);
  EXPECT_GT(double(json["solve"]["ratio"]), 0.1);
  EXPECT_LT(double(json["solve"]["ratio"]), 0.9);
  const RunResult shown = brume({"inspect", path("whole.irc")});
  EXPECT_THAT(shown.out, HasSubstr("in volumes"));
  EXPECT_THAT(shown.out, HasSubstr("2 orders, ratio "));
}

TEST_F(ScatteringCache, OneThreadAndAnyShardsMakeTheSameBytes) {
  const std::string wanted = whole();
  ASSERT_EQ(bake("one.irc", {"-t", "1"}).code, 0);
  EXPECT_TRUE(read("one.irc") == wanted);
  // Shards take the deep records from a cache of those alone, or solve for them.
  ASSERT_EQ(bake("deep.irc", {"--deep-only"}).code, 0);
  std::filesystem::copy_file(path("deep.irc"), path("a.irc"));
  ASSERT_EQ(bake("a.irc", {"--shard", "0/2"}).code, 0);
  ASSERT_EQ(bake("b.irc", {"--shard", "1/2"}).code, 0);
  const RunResult merged = brume({"merge", path("b.irc"), path("a.irc"), "-o", path("c.irc")});
  ASSERT_EQ(merged.code, 0) << merged.err;
  EXPECT_TRUE(read("c.irc") == wanted);
  // Once more there is nothing to do.
  const RunResult again = bake("deep.irc", {"--deep-only"});
  EXPECT_EQ(again.json()["written"], false);
  EXPECT_EQ(again.json()["records_added"], 0);
}

TEST_F(ScatteringCache, StoppedAgainAndAgainItComesToItsEnd) {
  const std::string wanted = whole();
  // What was gathered and solved is kept; placing records over again takes its time on any machine.
  int stops = 0;
  for (double limit = 0.1;; limit *= 1.2, ++stops) {
    const RunResult run =
        bake("c.irc", {"--time-limit", std::to_string(limit), "--seal-interval", "0"});
    if (run.code == 0) break;
    ASSERT_TRUE(run.code == 75 || run.code == 3) << run.err;
  }
  EXPECT_GT(stops, 2);
  EXPECT_TRUE(read("c.irc") == wanted);
}

TEST_F(ScatteringCache, RendersReadItAndAppendAnotherView) {
  const std::string wanted = whole();
  const auto render = [&](const std::string& name, const std::vector<std::string>& more) {
    const RunResult result = brume(arguments("render", name, more));
    EXPECT_EQ(result.code, 0) << result.err;
    return read(name);
  };
  const std::vector<std::string> read_only{"--spp",   "1", "--cache",
                                           path("whole.irc"), "--cache-mode", "read"};
  render("read.exr", read_only);
  render("memory.exr", {"--spp", "1"});
  const RunResult same = brume({"diff", path("read.exr"), path("memory.exr"), "--json"});
  EXPECT_EQ(same.json()["max"], 0) << same.out;
  EXPECT_TRUE(read("whole.irc") == wanted);
  const RunResult larger =
      bake("whole.irc", {"--res", "32x24", "--cache-mode", "append"});
  ASSERT_EQ(larger.code, 0) << larger.err;
  EXPECT_GT(int(larger.json()["records_added"]), 0);
  EXPECT_FALSE(larger.json().contains("orders") && larger.json()["orders"] != 0)
      << "deep records are not solved for again";
  const auto before = brume({"inspect", path("whole.irc"), "--json"}).json();
  EXPECT_EQ(before["solve"]["orders"], 2);
}

TEST_F(ScatteringCache, ToolsPassRecordsOfTheMediumOn) {
  const std::string wanted = whole();
  ASSERT_EQ(brume({"convert", path("whole.irc"), "-o", path("copy.irc")}).code, 0);
  EXPECT_TRUE(read("copy.irc") == wanted);
  const RunResult text = brume({"convert", path("whole.irc"), "-o", path("c.csv")});
  EXPECT_THAT(text.err, HasSubstr("only .irc holds them"));
  ASSERT_EQ(brume({"convert", path("c.csv"), "-o", path("back.irc")}).code, 0);
  ASSERT_EQ(bake("back.irc").code, 0);
  EXPECT_TRUE(read("back.irc") == wanted) << "what text leaves out is baked again";
  ASSERT_EQ(brume({"filter", path("whole.irc"), "-o", path("half.irc"), "--box", "-2,-2,-2,0,3,3"}).code, 0);
  ASSERT_EQ(bake("half.irc").code, 0);
  EXPECT_TRUE(read("half.irc") == wanted);
  const auto difference = brume({"diff", path("half.irc"), path("whole.irc"), "--json"}).json();
  EXPECT_EQ(difference["same_volume_records"], true);
}

}  // namespace
}  // namespace brume
