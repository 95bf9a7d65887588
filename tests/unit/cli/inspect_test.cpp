// brume inspect of caches: what scripts rely on, and who answers at a point.
#include <gmock/gmock.h>

#include "cli_fixture.h"

namespace brume {
namespace {

using testing::HasSubstr;

class Inspect : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    ASSERT_EQ(brume({"bake", write_scene(), "-o", path("c.irc"), "-t", "2"}).code, 0);
  }
  RunResult inspect(std::vector<std::string> more) {
    more.insert(more.begin(), {"inspect", path("c.irc")});
    return brume(more);
  }
  nlohmann::json json(std::vector<std::string> more) {
    more.push_back("--json");
    const RunResult result = inspect(more);
    EXPECT_EQ(result.code, 0) << result.err;
    return result.json();
  }
};

TEST_F(Inspect, JsonHasTheKeysThatScriptsRelyOn) {
  const auto all = json({});
  for (const char* key : {"format_version", "record_count", "records", "fingerprint", "settings",
                          "bounds", "sealed_blocks", "bad_records"})
    EXPECT_TRUE(all.contains(key)) << key;
  EXPECT_EQ(all["records"]["surface"], all["record_count"]);
  EXPECT_EQ(all["settings"]["bounces"], 1);
  EXPECT_EQ(all["partial"], false);
  int by_wave = 0;
  for (const auto& layer : all["layers"]) by_wave += int(layer["records"]);
  EXPECT_EQ(by_wave, all["record_count"]);
  for (const char* name : {"radius", "relative_error", "gradient"}) {
    const auto& histogram = all["histograms"][name];
    int sum = int(histogram["zeros"]) + int(histogram["not_finite"]);
    for (const auto& count : histogram["counts"]) sum += int(count);
    EXPECT_EQ(sum, all["record_count"]) << name;
    EXPECT_EQ(histogram["edges"].size(), histogram["counts"].size() + 1) << name;
  }
  for (int a = 0; a < 3; ++a) EXPECT_LE(all["bounds"][0][a], all["bounds"][1][a]);
}

TEST_F(Inspect, TextNamesUnitsAndWaves) {
  const std::string text = inspect({}).out;
  for (const char* part :
       {"radius [world units]", "W/m^2", "by wave", "fingerprint", "relative error"})
    EXPECT_THAT(text, HasSubstr(part));
}

TEST_F(Inspect, WeightsExplainTheAnswer) {
  const int count = json({})["record_count"];
  const std::string last = std::to_string(count - 1) + ":" + std::to_string(count);
  const auto record_there = json({"--records", last})["listed"][0];
  const auto text = [&](const char* key) {
    std::string numbers;
    for (const auto& x : record_there[key]) numbers += (numbers.empty() ? "" : ",") + x.dump();
    return numbers;
  };
  const auto at = json({"--at", text("position"), "--normal", text("normal")})["at"];
  EXPECT_EQ(at["layer"], 1);
  ASSERT_GT(at["records"].size(), 0u);
  double sum = 0, weights = 0;
  for (const auto& record : at["records"]) {
    EXPECT_GT(double(record["weight"]), 0);
    weights += double(record["weight"]);
    const double e = record["extrapolated"][1], own = record["irradiance"][1];
    sum += double(record["weight"]) * std::clamp(e, 0.0, 2 * own);
  }
  EXPECT_NEAR(double(at["irradiance"][1]), sum / weights, 1e-6 * sum / weights);
}

TEST_F(Inspect, TheNormalIsThatOfTheNearestRecordUnlessGiven) {
  EXPECT_EQ(json({"--at", "0,0,0"})["at"]["normal"], nlohmann::json::array({0, 1, 0}));
  EXPECT_EQ(json({"--at", "0,0,0", "--normal", "0,-2,0"})["at"]["records"].size(), 0u)
      << "nobody answers behind the floor";
  EXPECT_THAT(inspect({"--at", "0,5,0"}).out, HasSubstr("no record answers"));
  EXPECT_EQ(json({"--at", "0,0,0", "--layer", "0"})["at"]["layer"], 0);
}

TEST_F(Inspect, ListsRecordsOfARange) {
  const auto listed = json({"--records", "2:5"})["listed"];
  ASSERT_EQ(listed.size(), 3u);
  EXPECT_EQ(listed[0]["index"], 2);
  for (const char* key : {"key", "position", "normal", "irradiance", "gradient", "radius", "error"})
    EXPECT_TRUE(listed[0].contains(key)) << key;
  EXPECT_EQ(inspect({"--records", "5:2"}).code, 2);
  EXPECT_EQ(inspect({"--records", "1000000:1000001"}).code, 2);
}

TEST_F(Inspect, DeepShowsWhatPrecedesDamage) {
  std::string damaged = read("c.irc");
  damaged[damaged.size() - 3000] = static_cast<char>(damaged[damaged.size() - 3000] ^ 1);
  write("c.irc", damaged);
  const RunResult plain = inspect({"--json"});
  EXPECT_EQ(plain.code, 3);
  EXPECT_EQ(plain.out, "");
  const RunResult deep = inspect({"--json", "--deep"});
  EXPECT_EQ(deep.code, 3);
  EXPECT_EQ(deep.json()["complete"], false);
  EXPECT_GT(int(deep.json()["record_count"]), 0);
  EXPECT_TRUE(deep.json().contains("fault"));
  EXPECT_LT(int(deep.json()["valid_bytes"]), int(deep.json()["file_bytes"]));
}

}  // namespace
}  // namespace brume
