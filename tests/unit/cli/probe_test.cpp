// brume probe: keys, units, and gradients against their finite differences.
#include <gmock/gmock.h>

#include <cmath>

#include "cli_fixture.h"

namespace brume {
namespace {

class Probe : public CliTest {
 protected:
  RunResult probe(std::vector<std::string> more, const std::string& at = "0.3,0,0.2") {
    std::vector<std::string> arguments{"probe", write_scene(), "--at", at, "--normal", "0,2,0"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return brume(arguments);
  }
  static double at(const nlohmann::json& gradient, int channel, int axis) {
    return gradient[channel][axis];
  }
};

TEST_F(Probe, JsonHasTheKeysThatScriptsRelyOn) {
  const RunResult result = probe({"--json"});
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = result.json();
  for (const char* key :
       {"position", "normal", "irradiance", "irradiance_direct", "irradiance_surface",
        "irradiance_media", "gradient", "gradient_terms", "gradient_rotational", "radius", "cells",
        "shells", "rays", "segments", "seconds"})
    EXPECT_TRUE(json.contains(key)) << key;
  EXPECT_FALSE(json.contains("finite_difference"));
  EXPECT_EQ(json["normal"], nlohmann::json::array({0.0, 1.0, 0.0}));
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(double(json["irradiance"][c]),
                double(json["irradiance_surface"][c]) + double(json["irradiance_media"][c]), 1e-9);
    EXPECT_GT(double(json["irradiance_direct"][c]), 0);
    for (int axis = 0; axis < 3; ++axis) {
      double sum = 0;
      for (const char* term : {"radial", "walls", "grad_sigma", "directional"})
        sum += at(json["gradient_terms"][term], c, axis);
      EXPECT_NEAR(at(json["gradient"], c, axis), sum, 1e-9);
    }
  }
}

TEST_F(Probe, GradientsMatchTheirFiniteDifferences) {
  const auto json =
      probe({"--json", "--cells", "64x201", "--shells", "48", "--finite-difference", "0.02"},
            "0.3,0.4,0.2")
          .json();
  ASSERT_TRUE(json.contains("finite_difference"));
  double error = 0, size = 0, noise = 0;
  for (int c = 0; c < 3; ++c)
    for (int axis = 0; axis < 3; ++axis) {
      noise += std::pow(at(json["finite_difference_noise"], c, axis), 2);
      error += std::pow(at(json["gradient"], c, axis) - at(json["finite_difference"], c, axis), 2);
      size += std::pow(at(json["finite_difference"], c, axis), 2);
    }
  EXPECT_LT(std::sqrt(error), 0.05 * std::sqrt(size) + 3 * std::sqrt(noise));
  EXPECT_LT(std::sqrt(noise), 0.15 * std::sqrt(size));
}

TEST_F(Probe, EveryModeComesFromTheSameSamples) {
  const auto full = probe({"--json"}).json();
  for (const char* mode : {"none", "ward-heckbert", "media", "full"}) {
    const auto own = probe({"--json", "--gradient", mode}).json();
    EXPECT_EQ(own["irradiance"], full["irradiance"]) << mode;
    EXPECT_EQ(own["gradient"], full["gradient_modes"][mode]) << mode;
  }
}

TEST_F(Probe, SweepShowsHowAnswersSettle) {
  const RunResult result = probe({"--json", "--sweep", "cells", "--shells", "8"});
  ASSERT_EQ(result.code, 0) << result.err;
  const auto sweep = result.json()["sweep"];
  ASSERT_EQ(sweep.size(), 6u);
  EXPECT_EQ(sweep[0]["cells"], nlohmann::json::array({4, 13}));
  EXPECT_EQ(sweep[5]["cells"], nlohmann::json::array({128, 402}));
  EXPECT_LT(double(sweep[4]["gradient_rms"]), 0.5 * double(sweep[0]["gradient_rms"]));
  EXPECT_LT(double(sweep[4]["irradiance_rms"]), 0.5 * double(sweep[0]["irradiance_rms"]));
  EXPECT_EQ(sweep[3]["gradient_rms"], sweep[3]["gradient_rms_modes"]["full"]);
  EXPECT_NEAR(double(sweep[3]["gradient_rms_modes"]["none"]), 1, 1e-9);
  EXPECT_GT(double(sweep[4]["gradient_rms_modes"]["media"]), double(sweep[4]["gradient_rms"]));
}

TEST_F(Probe, SweepsOverCellsOnly) {
  const RunResult result = probe({"--sweep", "shells"});
  EXPECT_EQ(result.code, 2);
  EXPECT_THAT(result.err, testing::HasSubstr("cells"));
}

TEST_F(Probe, ModeNoneGivesZeros) {
  const auto json = probe({"--json", "--gradient", "none"}).json();
  for (int c = 0; c < 3; ++c)
    for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(at(json["gradient"], c, axis), 0);
}

TEST_F(Probe, GradientsArePerMetreWhateverTheUnit) {
  // The same room in centimetres: positions, bounds and intensities stay, metres shrink by 100.
  const auto metres = probe({"--json"}).json();
  write_scene("cm.json", "\"unit\": 0.01,");
  const auto centimetres =
      brume({"probe", path("cm.json"), "--at", "0.3,0,0.2", "--normal", "0,1,0", "--json"}).json();
  // A point light's irradiance grows by 100^2, the medium's and surfaces' answers with it; a
  // gradient per metre by another 100. Keys hash metres, so deep records have other random numbers.
  EXPECT_NEAR(double(centimetres["irradiance"][0]) / double(metres["irradiance"][0]), 1e4, 150);
  EXPECT_NEAR(at(centimetres["gradient"], 0, 0) / at(metres["gradient"], 0, 0), 1e6, 1e5);
  EXPECT_NEAR(double(centimetres["radius"][0]) / double(metres["radius"][0]), 1, 0.02);
}

TEST_F(Probe, TheSeedDecidesTheNumbers) {
  const auto one = probe({"--json", "--seed", "5"}).json();
  EXPECT_EQ(one["irradiance"], probe({"--json", "--seed", "5", "-t", "3"}).json()["irradiance"]);
  EXPECT_NE(one["irradiance"], probe({"--json", "--seed", "6"}).json()["irradiance"]);
}

TEST_F(Probe, TextShowsEveryMode) {
  const RunResult result = probe({});
  EXPECT_EQ(result.code, 0) << result.err;
  for (const char* word : {"irradiance", "walls", "grad_sigma", "ward-heckbert", "media", "radius"})
    EXPECT_THAT(result.out, testing::HasSubstr(word));
}

TEST_F(Probe, ACacheSuppliesFurtherBounces) {
  ASSERT_EQ(brume({"bake", write_scene(), "-o", path("c.irc"), "--bounces", "2"}).code, 0);
  const RunResult result = probe({"--json", "--cache", path("c.irc")});
  ASSERT_EQ(result.code, 0) << result.err;
  const auto baked = probe({"--json", "--bounces", "2"}).json();
  EXPECT_NEAR(double(result.json()["irradiance"][0]) / double(baked["irradiance"][0]), 1, 0.05);
  EXPECT_EQ(probe({"--cache", path("none.irc")}).code, 3);
}

class VolumeProbe : public CliTest {
 protected:
  RunResult probe(const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"probe", write_scene(), "--at", "0.3,0.9,0.2", "--volume"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return brume(arguments);
  }
};

TEST_F(VolumeProbe, JsonHasTheKeysThatScriptsRelyOn) {
  const RunResult result = probe({"--json", "--volume-bounces", "4"});
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = result.json();
  for (const char* key : {"position", "fluence", "gradient", "gradient_terms", "gradient_modes",
                          "radius", "cells", "rays", "segments", "seconds"})
    EXPECT_TRUE(json.contains(key)) << key;
  EXPECT_FALSE(json.contains("normal"));
  ASSERT_EQ(json["radius"].size(), 3u);
  for (int c = 0; c < 3; ++c) {
    EXPECT_GT(double(json["radius"][c]), 0);
    EXPECT_GT(double(json["fluence_media"][c]), 0);
    EXPECT_NEAR(double(json["fluence"][c]),
                double(json["fluence_surface"][c]) + double(json["fluence_media"][c]), 1e-9);
  }
}

TEST_F(VolumeProbe, TermsSumToTheGradientInEveryMode) {
  for (const char* mode : {"none", "ward-heckbert", "media", "full"}) {
    const auto json = probe({"--json", "--gradient", mode}).json();
    EXPECT_EQ(json["mode"], mode);
    EXPECT_EQ(json["gradient"], json["gradient_modes"][mode]);
    for (int c = 0; c < 3; ++c)
      for (int a = 0; a < 3; ++a) {
        double sum = 0;
        for (const auto& [name, term] : json["gradient_terms"].items()) sum += double(term[c][a]);
        EXPECT_NEAR(sum, double(json["gradient"][c][a]), 1e-9) << mode;
      }
  }
}

TEST_F(VolumeProbe, GradientsMatchTheirFiniteDifferences) {
  // Light scattered once, and that which scatters on from volume records, with bounces.
  for (const std::vector<std::string>& light :
       {std::vector<std::string>{"--volume-bounces", "1"},
        std::vector<std::string>{"--volume-bounces", "5", "--bounces", "2"}}) {
    std::vector<std::string> arguments{"--json", "--cells", "64x201", "--shells", "48",
                                       "--finite-difference", "0.02"};
    arguments.insert(arguments.end(), light.begin(), light.end());
    const auto json = probe(arguments).json();
    double error = 0, size = 0, noise = 0, ward = 0;
    for (int c = 0; c < 3; ++c)
      for (int a = 0; a < 3; ++a) {
        const double expected = json["finite_difference"][c][a];
        noise += std::pow(double(json["finite_difference_noise"][c][a]), 2);
        error += std::pow(double(json["gradient"][c][a]) - expected, 2);
        ward += std::pow(double(json["gradient_modes"]["ward-heckbert"][c][a]) - expected, 2);
        size += expected * expected;
      }
    EXPECT_LT(std::sqrt(error), 0.05 * std::sqrt(size) + 3 * std::sqrt(noise));
    EXPECT_GT(std::sqrt(ward), 2 * std::sqrt(error));
  }
}

TEST_F(VolumeProbe, TakesNoNormal) {
  EXPECT_EQ(probe({"--normal", "0,1,0"}).code, 2);
  EXPECT_EQ(brume({"probe", write_scene(), "--at", "0,1,0"}).code, 2);
}

}  // namespace
}  // namespace brume
