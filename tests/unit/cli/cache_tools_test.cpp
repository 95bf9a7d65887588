// brume filter, convert and diff of caches, on a cache that was baked.
#include <gmock/gmock.h>

#include "cli_fixture.h"

namespace brume {
namespace {

using testing::HasSubstr;

class CacheTools : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    bake("c.irc");
  }
  RunResult bake(const std::string& name, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"bake",   write_scene(), "-o", path(name),
                                       "--json", "-t",          "2"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const RunResult result = brume(arguments);
    EXPECT_EQ(result.code, 0) << result.err;
    return result;
  }
  RunResult filter(const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"filter", path("c.irc"), "-o", path(name), "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return brume(arguments);
  }
  int count(const std::string& name) {
    return brume({"inspect", path(name), "--json"}).json()["record_count"];
  }
  nlohmann::json difference(const std::string& a, const std::string& b) {
    const RunResult result = brume({"diff", path(a), path(b), "--json"});
    EXPECT_EQ(result.code, 0) << result.err;
    return result.json();
  }
};

TEST_F(CacheTools, APartIsFilledAgainToTheCacheItCameFrom) {
  const RunResult half = filter("half.irc", {"--box", "-2,-2,-2,0,3,3"});
  ASSERT_EQ(half.code, 0) << half.err;
  EXPECT_EQ(half.json()["partial"], true);
  EXPECT_EQ(half.json()["resumable"], true);
  const int dropped = half.json()["dropped"];
  EXPECT_GT(dropped, 0);
  EXPECT_EQ(brume({"inspect", path("half.irc"), "--json"}).json()["partial"], true);
  EXPECT_EQ(brume({"render", write_scene(), "-o", path("a.exr"), "--cache", path("half.irc"),
                   "--cache-mode", "read", "--spp", "1"})
                .code,
            0)
      << "renders read parts";
  EXPECT_EQ(bake("half.irc").json()["records_added"], dropped);
  EXPECT_TRUE(read("half.irc") == read("c.irc"));
}

TEST_F(CacheTools, APartWithoutDeeperBouncesIsStaleForEveryScene) {
  const RunResult top = filter("top.irc", {"--layer", "1"});
  ASSERT_EQ(top.code, 0) << top.err;
  EXPECT_EQ(top.json()["resumable"], false);
  EXPECT_THAT(top.err, HasSubstr("another fingerprint"));
  const RunResult result = brume({"bake", write_scene(), "-o", path("top.irc")});
  EXPECT_EQ(result.code, 3);
  EXPECT_THAT(result.err, HasSubstr("stale"));
}

TEST_F(CacheTools, DeeperBouncesAloneAreGoneOnFrom) {
  const RunResult deep = filter("deep.irc", {"--layer", "0"});
  EXPECT_EQ(deep.json()["resumable"], true) << deep.err;
  bake("deep.irc");
  EXPECT_TRUE(read("deep.irc") == read("c.irc"));
}

TEST_F(CacheTools, AFilterThatDropsNothingChangesNoByte) {
  const RunResult all = filter("all.irc", {"--radius", "0:"});
  EXPECT_EQ(all.json()["partial"], false);
  EXPECT_TRUE(read("all.irc") == read("c.irc"));
}

TEST_F(CacheTools, WhatOneFilterKeepsItsInverseDrops) {
  const auto kept = filter("a.irc", {"--radius", "0.1:0.2"}).json();
  const auto rest = filter("b.irc", {"--radius", "0.1:0.2", "--invert"}).json();
  const auto top = filter("top.irc", {"--layer", "1"}).json();
  const int whole = count("c.irc"), deeper = whole - int(top["records"]);
  EXPECT_GT(deeper, 0);
  EXPECT_EQ(int(kept["records"]) + int(rest["records"]), whole + deeper);
}

TEST_F(CacheTools, KeysChooseSingleRecords) {
  const auto listed =
      brume({"inspect", path("c.irc"), "--records", "0:2", "--json"}).json()["listed"];
  const std::string keys =
      listed[0]["key"].get<std::string>() + "," + listed[1]["key"].get<std::string>();
  write("keys.txt", listed[1]["key"].get<std::string>() + "\n");
  EXPECT_EQ(filter("a.irc", {"--layer", "0", "--keys", keys}).json()["records"], 2);
  EXPECT_EQ(filter("b.irc", {"--layer", "0", "--keys", "@" + path("keys.txt")}).json()["records"],
            1);
  EXPECT_EQ(filter("d.irc", {"--keys", "xyz"}).code, 2);
}

TEST_F(CacheTools, ThinnedRecordsKeepTheirDistance) {
  ASSERT_EQ(filter("thin.irc", {"--layer", "1", "--thin", "0.3"}).code, 0);
  const int n = count("thin.irc");
  EXPECT_LT(n, count("c.irc"));
  const auto records =
      brume({"inspect", path("thin.irc"), "--records", "0:100000", "--json"}).json()["listed"];
  ASSERT_EQ(static_cast<int>(records.size()), n);
  for (std::size_t i = 0; i < records.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      double distance2 = 0, cosine = 0;
      for (int a = 0; a < 3; ++a) {
        const double d = double(records[i]["position"][a]) - double(records[j]["position"][a]);
        distance2 += d * d;
        cosine += double(records[i]["normal"][a]) * double(records[j]["normal"][a]);
      }
      EXPECT_TRUE(distance2 > 0.08999 || cosine < 0.801) << i << " and " << j;
    }
}

TEST_F(CacheTools, SalvageTakesWhatADamagedCacheStillHolds) {
  const std::string good = read("c.irc");
  write("c.irc", good.substr(0, good.size() - 3000));
  const RunResult refused = filter("a.irc", {});
  EXPECT_EQ(refused.code, 3);
  EXPECT_THAT(refused.err, HasSubstr("--salvage"));
  const RunResult saved = filter("a.irc", {"--salvage"});
  ASSERT_EQ(saved.code, 0) << saved.err;
  EXPECT_EQ(saved.json()["partial"], true);
  EXPECT_GT(int(saved.json()["records"]), 0);
  bake("a.irc");
  EXPECT_TRUE(read("a.irc") == good) << "filled again";
  write("c.irc", "nothing of ours");
  EXPECT_EQ(filter("b.irc", {"--salvage"}).code, 3);
}

TEST_F(CacheTools, TextComesBackAsTheSameBytes) {
  for (const char* name : {"c.csv", "c.jsonl"}) {
    ASSERT_EQ(brume({"convert", path("c.irc"), "-o", path(name)}).code, 0);
    ASSERT_EQ(brume({"convert", path(name), "-o", path("back.irc")}).code, 0);
    EXPECT_TRUE(read("back.irc") == read("c.irc")) << name;
  }
  EXPECT_EQ(difference("back.irc", "c.irc")["equal"], count("c.irc"));
}

TEST_F(CacheTools, ExportsAreOfTheRecordsThatEyeRaysAsk) {
  const int top = filter("top.irc", {"--layer", "1"}).json()["records"];
  for (const char* name : {"c.ply", "c.vdb"}) {
    const RunResult result = brume({"convert", path("c.irc"), "-o", path(name), "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(result.json()["records"], top);
  }
  EXPECT_EQ(brume({"convert", path("c.irc"), "-o", path("c.ply"), "--all-layers", "--json"})
                .json()["records"],
            count("c.irc"));
  const RunResult splat =
      brume({"convert", path("c.irc"), "-o", path("s.vdb"), "--splat", "--voxel", "0.1", "--json"});
  ASSERT_EQ(splat.code, 0) << splat.err;
  EXPECT_GT(int(splat.json()["voxels"]), 100);
  const auto grids = brume({"inspect", path("s.vdb"), "--json"});
  for (const char* grid : {"irradiance", "weight", "count"})
    EXPECT_THAT(grids.out, HasSubstr(grid));
}

TEST_F(CacheTools, ConvertRefusesWhatDoesNotGoTogether) {
  const std::string cache = path("c.irc");
  EXPECT_EQ(brume({"convert", cache, "-o", path("a.xyz")}).code, 2);
  EXPECT_EQ(brume({"convert", cache, "-o", path("a.vdb"), "--splat"}).code, 2);
  EXPECT_EQ(brume({"convert", cache, "-o", path("a.ply"), "--splat", "--voxel", "1"}).code, 2);
  EXPECT_EQ(brume({"convert", cache, "-o", path("a.csv"), "--layer", "1"}).code, 2);
  EXPECT_EQ(brume({"convert", path("none.irc"), "-o", path("a.csv")}).code, 3);
  EXPECT_EQ(brume({"convert", cache, "-o", path("none/a.csv")}).code, 6);
}

TEST_F(CacheTools, ADifferenceTellsOfRecordsSettingsAndLight) {
  bake("more.irc", {"--cells", "8x25"});
  const auto d = difference("more.irc", "c.irc");
  EXPECT_EQ(d["same_fingerprint"], false);
  EXPECT_EQ(d["settings"]["cells"]["a"], nlohmann::json::array({8, 25}));
  EXPECT_EQ(d["settings"].size(), 1u);
  EXPECT_GT(int(d["different"]), 0) << "first waves choose the same points";
  EXPECT_GT(double(d["rmse"]), 0);
  EXPECT_LT(double(d["rmse"]), 1);
  EXPECT_GT(double(d["gradient_rmse"]), 0);
  EXPECT_LT(double(d["answers_rmse"]), 1);
  const auto same = difference("c.irc", "c.irc");
  EXPECT_EQ(same["equal"], count("c.irc"));
  for (const char* key : {"only_a", "only_b", "different", "mae", "rmse", "max", "gradient_rmse"})
    EXPECT_EQ(same[key], 0) << key;
}

TEST_F(CacheTools, ADifferenceFailsAboveItsThreshold) {
  filter("part.irc", {"--box", "-2,-2,-2,0,3,3"});
  const std::string part = path("part.irc"), whole = path("c.irc");
  EXPECT_EQ(brume({"diff", part, whole, "--fail-above", "different=0"}).code, 0);
  const RunResult result = brume({"diff", part, whole, "--fail-above", "only_b=0", "--json"});
  EXPECT_EQ(result.code, 5);
  EXPECT_THAT(result.err, HasSubstr("only_b"));
  EXPECT_TRUE(result.json().is_object());
  EXPECT_EQ(brume({"diff", part, whole, "--fail-above", "flip=0"}).code, 2);
  EXPECT_EQ(brume({"diff", part, whole, "--heat-map", path("a.png")}).code, 2);
  EXPECT_EQ(brume({"diff", part, write_scene()}).code, 3);
}

}  // namespace
}  // namespace brume
