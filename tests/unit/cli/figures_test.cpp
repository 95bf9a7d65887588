// brume figures: what it leaves behind, and that a browser shows it.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>

#include "cli_fixture.h"
#include "study/chart_library.h"

namespace brume {
namespace {

using testing::HasSubstr;
using testing::Not;

class Figures : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    const auto folders = chart_library_folders();
    if (std::none_of(folders.begin(), folders.end(),
                     [](const auto& folder) { return std::filesystem::exists(folder); }))
      GTEST_SKIP() << "Chart.js is absent: install libjs-chart.js";
  }
  RunResult figures(const std::string& folder, const std::string& only,
                    const std::string& threads) {
    return brume({"figures", "-o", path(folder), "--quick", "--only", only, "--json", "--progress",
                  "none", "-t", threads});
  }
  // As the page says when its script is through; nothing where the browser complains.
  std::string charts_drawn_by_a_browser(const std::string& page) const {
    const std::string command =
        "HOME='" + folder_.string() +
        "' timeout 100 chromium --headless --no-sandbox --disable-gpu --enable-logging=stderr "
        "--virtual-time-budget=10000 --user-data-dir='" +
        path("profile") + "' --dump-dom 'file://" + path(page) + "' >'" + path("dom") + "' 2>'" +
        path("log") + "'";
    EXPECT_EQ(std::system(command.c_str()), 0) << read("log");
    EXPECT_THAT(read("log"), Not(HasSubstr("CONSOLE")));
    const std::string dom = read("dom");
    const std::size_t at = dom.find("data-charts=");
    return at == std::string::npos ? "" : dom.substr(at, dom.find('"', at + 13) + 1 - at);
  }
  std::size_t count(const std::string& text, const std::string& part) const {
    std::size_t n = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
      ++n;
    return n;
  }
};

TEST_F(Figures, OfAGroundAreOnePageThatNeedsNothingElse) {
  const RunResult result = figures("a", "no-walls", "2");
  ASSERT_EQ(result.code, 0) << result.err;
  const auto json = result.json();
  ASSERT_EQ(json.at("scenes").size(), 1u);
  const auto& scene = json.at("scenes")[0];
  EXPECT_EQ(scene.at("name"), "no-walls");
  EXPECT_EQ(scene.at("regather_change"), 0);
  for (const char* set : {"as_baked", "sparse"}) {
    const auto& relmse = scene.at("interpolation").at(set).at("relmse");
    for (const char* mode : {"none", "ward-heckbert", "media", "full"})
      EXPECT_GT(relmse.at(mode), 0.0) << mode;
    // Nothing that Ward-Heckbert could see: the very same numbers.
    EXPECT_EQ(relmse.at("none"), relmse.at("ward-heckbert"));
  }
  EXPECT_LT(scene.at("interpolation").at("sparse").at("relmse").at("full"),
            scene.at("interpolation").at("sparse").at("relmse").at("none"));

  const std::string page = read("a/index.html");
  EXPECT_EQ(nlohmann::json::parse(read("a/figures.json")), json);
  std::size_t pictures = 0;
  for (const auto& entry : std::filesystem::directory_iterator(path("a")))
    pictures += entry.path().extension() == ".png";
  EXPECT_EQ(pictures, 15u);  // View, irradiance, five gradients, four modes twice.
  EXPECT_EQ(count(page, "src=\"data:image/png;base64,"), pictures);
  for (const char* outside : {"src=\"http", "href=\"http", "src=\"/", "url(http", "@import"})
    EXPECT_THAT(page, Not(HasSubstr(outside)));
  EXPECT_THAT(page, HasSubstr("Chart.js v"));
  EXPECT_TRUE(exists("a/scenes/no-walls/no-walls.json"));
  // The page's script counts the charts that it drew: line, two convergences, two of interpolation.
  if (std::system("command -v chromium >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "no browser to look at the page with: install chromium";
  EXPECT_EQ(charts_drawn_by_a_browser("a/index.html"), "data-charts=\"5\"");
}

TEST_F(Figures, ArePicturesThatDoNotDependOnThreads) {
  ASSERT_EQ(figures("one", "window", "1").code, 0);
  ASSERT_EQ(figures("two", "window", "2").code, 0);
  std::size_t compared = 0;
  for (const auto& entry : std::filesystem::directory_iterator(path("one"))) {
    if (entry.path().extension() != ".png") continue;
    const std::string name = entry.path().filename().string();
    EXPECT_TRUE(read("one/" + name) == read("two/" + name)) << name;
    ++compared;
  }
  EXPECT_EQ(compared, 5u);  // Both gradients, the reference, two errors.
}

TEST_F(Figures, RefuseUnknownScenesAndFoldersThatCannotBe) {
  const RunResult unknown = figures("a", "windows", "1");
  EXPECT_EQ(unknown.code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("smoky-cornell, window"));
  EXPECT_FALSE(exists("a/index.html"));
  write("file", "");
  EXPECT_EQ(figures("file/a", "window", "1").code, 6);
}

}  // namespace
}  // namespace brume
