// One cache for many cameras: a view it was not baked for, and a flight that does not flicker.
#include <gmock/gmock.h>

#include "cli_fixture.h"
#include "core/image.h"

namespace brume {
namespace {

using testing::HasSubstr;

class Reuse : public CliTest {
 protected:
  // Cameras left, right and low look at the room's middle; between lies among them; c0 to c3 fly
  // by.
  std::string scene() {
    const auto camera = [](const std::string& name, double x, double y, double z) {
      return "\"" + name + "\": {\"position\": [" + std::to_string(x) + "," + std::to_string(y) +
             "," + std::to_string(z) + "], \"look_at\": [0, 0.9, -0.2], \"fov_deg\": 60}";
    };
    std::string cameras = camera("left", -0.7, 1.2, 0.8) + "," + camera("right", 0.7, 1.2, 0.8) +
                          "," + camera("low", 0, 0.5, 0.85) + "," +
                          camera("between", 0.1, 1.1, 0.8);
    for (int i = 0; i < 3; ++i)
      cameras += "," + camera("c" + std::to_string(i), -0.3 + 0.15 * i, 1 + 0.05 * i, 0.85);
    return write_scene("views.json", "\"cameras\": {" + cameras + "},");
  }
  nlohmann::json bake(const std::string& views) {
    const RunResult result = brume({"bake", scene(), "-o", path("c.irc"), "--views", views, "--res",
                                    "32x24", "--json", "-t", "2"});
    EXPECT_EQ(result.code, 0) << result.err;
    return result.json();
  }
  nlohmann::json render(const std::string& camera, const std::string& out,
                        std::vector<std::string> more) {
    std::vector<std::string> arguments{"render", scene(), "--camera", camera, "-o", path(out),
                                       "--res",  "32x24", "--json",   "-t",   "2"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const RunResult result = brume(arguments);
    EXPECT_EQ(result.code, 0) << result.err;
    return result.json();
  }
};

TEST_F(Reuse, ACacheOfThreeCamerasRendersAFourthView) {
  bake("left,right,low");
  const auto shared = render("between", "shared.exr",
                             {"--cache", path("c.irc"), "--cache-mode", "read", "--spp", "16"});
  EXPECT_EQ(shared["records_added"], 0);
  // 768 pixels of 16 samples each.
  EXPECT_LT(int(shared["fallback_gathers"]), 768 * 16 / 50) << "next to all of it is covered";
  render("between", "own.exr", {"--spp", "16"});
  const auto difference = brume({"diff", path("shared.exr"), path("own.exr"), "--layer",
                                 "diffuse_indirect", "--blocks", "8", "--json"})
                              .json();
  EXPECT_LT(std::abs(double(difference["signed_mean"])), 0.02);
  EXPECT_LT(double(difference["block_nrmse"]), 0.08);
}

TEST_F(Reuse, AFlightFromOneCacheFlickersLessThanFromACacheAFrame) {
  bake("c0,c1,c2");
  std::vector<std::string> one, own, references, second;
  for (const std::string camera : {"c0", "c1", "c2"}) {
    const auto file = [&](const std::string& kind, std::vector<std::string>& list) {
      list.push_back(path(kind + camera + ".exr"));
      return kind + camera + ".exr";
    };
    const auto shared = render(camera, file("one", one),
                               {"--cache", path("c.irc"), "--cache-mode", "read", "--spp", "16"});
    EXPECT_EQ(shared["records_added"], 0) << "one bake is enough";
    EXPECT_EQ(shared["fallback_gathers"], 0);
    render(camera, file("own", own), {"--spp", "16", "--seed", std::to_string(camera[1])});
    const std::vector<std::string> path_traced{"--integrator", "path", "--transport", "cached",
                                               "--spp",        "256",  "--seed"};
    for (const char* seed : {"1001", "2002"}) {
      std::vector<std::string> options = path_traced;
      options.push_back(seed);
      render(camera, seed == std::string("1001") ? file("ref", references) : file("second", second),
             options);
    }
  }
  const auto flicker = [&](const std::vector<std::string>& frames) {
    std::vector<std::string> arguments{"flicker", "--json"};
    arguments.insert(arguments.end(), frames.begin(), frames.end());
    arguments.push_back("--reference");
    arguments.insert(arguments.end(), references.begin(), references.end());
    arguments.push_back("--second-reference");
    arguments.insert(arguments.end(), second.begin(), second.end());
    const RunResult result = brume(arguments);
    EXPECT_EQ(result.code, 0) << result.err;
    return result.json();
  };
  const auto shared = flicker(one), each = flicker(own);
  ASSERT_EQ(shared["pairs"].size(), 2u);
  EXPECT_GT(double(shared["matched"]), 0.5);
  EXPECT_LT(double(shared["error_change"]), 0.02) << shared.dump(2);
  EXPECT_LT(double(shared["error_change"]), 0.5 * double(each["error_change"])) << each.dump(2);
  std::vector<std::string> strict{"flicker", "--fail-above", "change=0"};
  strict.insert(strict.end(), one.begin(), one.end());
  const RunResult failed = brume(strict);
  EXPECT_EQ(failed.code, 5);
  EXPECT_THAT(failed.err, HasSubstr("change"));
}

TEST_F(Reuse, FlickerRefusesWhatItCannotMeasure) {
  const auto a = path("a.exr");
  render("c0", "a.exr", {"--spp", "1"});
  EXPECT_EQ(brume({"flicker", a}).code, 2) << "one frame";
  EXPECT_EQ(brume({"flicker", a, a, "--reference", a}).code, 2);
  EXPECT_EQ(brume({"flicker", a, a, "--second-reference", a, a}).code, 2);
  EXPECT_EQ(brume({"flicker", a, a, "--layer", "nothing"}).code, 3);
  render("c0", "b.exr", {"--spp", "1", "--aovs", "diffuse_indirect"});
  EXPECT_THAT(brume({"flicker", a, path("b.exr")}).err, HasSubstr("P.X"));
  EXPECT_EQ(brume({"flicker", a, path("b.exr")}).code, 3);
}

}  // namespace
}  // namespace brume
