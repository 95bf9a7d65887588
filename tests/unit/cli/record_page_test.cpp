// brume inspect --html: the page in a browser without a network or a screen.
#include <gmock/gmock.h>

#include <regex>
#include <set>

#include "cli_fixture.h"
#include "core/image.h"

namespace brume {
namespace {

using testing::HasSubstr;
using testing::Not;

class RecordPage : public CliTest {
 protected:
  void SetUp() override {
    CliTest::SetUp();
    if (!std::filesystem::exists("/usr/share/javascript/three/three.min.js"))
      GTEST_SKIP() << "the package libjs-three is absent";
    ASSERT_EQ(brume({"bake", write_scene(), "-o", path("c.irc"), "-t", "2"}).code, 0);
  }

  struct Browsing {
    std::string document, messages;
    int number(const std::string& marker) const {
      std::smatch found;
      return std::regex_search(document, found, std::regex(marker + "=\"(\\d+)\""))
                 ? std::stoi(found[1])
                 : -1;
    }
  };
  // What the page has become after it ran, and its picture in "page.png".
  Browsing browse(const std::string& address) {
    const std::string command =
        "cd '" + folder_.string() +
        "' && timeout 120 chromium --headless --no-sandbox --disable-gpu --use-gl=angle "
        "--use-angle=swiftshader --enable-unsafe-swiftshader --no-first-run "
        "--disable-background-networking --host-resolver-rules='MAP * ~NOTFOUND' "
        "--user-data-dir=profile --window-size=900,600 --virtual-time-budget=4000 "
        "--enable-logging=stderr --dump-dom --screenshot=page.png 'file://" +
        path(address) + "' >page.dom 2>page.err";
    EXPECT_EQ(std::system(command.c_str()), 0) << read("page.err");
    return {read("page.dom"), read("page.err")};
  }
  static bool has_browser() { return std::system("chromium --version >/dev/null 2>&1") == 0; }
  // Different colours left of the panel, where the view is.
  std::size_t colours_of_view() {
    const Image image = read_image(path("page.png")).image;
    const std::vector<Rgb> pixels = image.layer("");
    std::set<std::array<float, 3>> colours;
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < 900 - 330; ++x) {
        const Rgb& c = pixels[static_cast<std::size_t>(y * image.width + x)];
        colours.insert({c.r, c.g, c.b});
      }
    return colours.size();
  }
  nlohmann::json inspect(const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"inspect", path("c.irc"), "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const RunResult result = brume(arguments);
    EXPECT_EQ(result.code, 0) << result.err;
    return result.json();
  }
};

TEST_F(RecordPage, DrawsADiscForEveryRecordOverTheSurfaces) {
  if (!has_browser()) GTEST_SKIP() << "chromium is absent";
  const auto summary = inspect({write_scene(), "--html", path("page.html")});
  const Browsing seen = browse("page.html#colour=error&arrows&logarithmic&layer=-1&record=3");
  EXPECT_THAT(seen.document, HasSubstr("data-state=\"ready\"")) << seen.messages;
  EXPECT_EQ(seen.number("data-discs"), summary["record_count"]);
  EXPECT_GT(seen.number("data-arrows"), 0);
  EXPECT_EQ(seen.number("data-record"), 3);
  const auto third = inspect({"--records", "3:4"})["listed"][0];
  EXPECT_THAT(seen.document, HasSubstr(third["key"].get<std::string>())) << "its numbers are shown";
  EXPECT_THAT(seen.messages, Not(HasSubstr("Uncaught")));
  EXPECT_THAT(seen.messages, Not(HasSubstr("THREE.")));
  EXPECT_GT(colours_of_view(), 500u) << "the view is blank, or one colour";
}

TEST_F(RecordPage, ShowsRecordsAloneAndOneBounceUnlessAsked) {
  if (!has_browser()) GTEST_SKIP() << "chromium is absent";
  const auto summary = inspect({"--html", path("page.html")});
  int top = 0;
  for (const auto& layer : summary["layers"])
    if (layer["layer"] == 1) top += int(layer["records"]);
  const Browsing seen = browse("page.html");
  EXPECT_EQ(seen.number("data-discs"), top) << seen.messages;
  EXPECT_GT(colours_of_view(), 100u);
}

TEST_F(RecordPage, IsOneFileThatNamesNoOther) {
  const std::string scene = write_scene();
  inspect({scene, "--html", path("a.html")});
  inspect({scene, "--html", path("b.html")});
  const std::string page = read("a.html");
  EXPECT_TRUE(page == read("b.html")) << "the same again";
  for (const char* link : {" src=", "<link", "@import", "import(", "@DATA", "@THREE"})
    EXPECT_EQ(page.find(link), std::string::npos) << link;
  EXPECT_THAT(page.substr(0, 20000), HasSubstr("MIT License"));
}

TEST_F(RecordPage, SaysWhatItNeedsAndWhatDoesNotBelong) {
  const RunResult without =
      brume({"inspect", path("c.irc"), "--html", path("a.html"), "--three-js", path("none.js")});
  EXPECT_EQ(without.code, 3);
  EXPECT_THAT(without.err, HasSubstr("libjs-three"));
  EXPECT_FALSE(exists("a.html"));
  EXPECT_EQ(brume({"inspect", path("c.irc"), write_scene()}).code, 2) << "a scene without a page";
  const RunResult other = brume({"inspect", path("c.irc"), write_scene(), "--html", path("a.html"),
                                 "-D", "/lights/0/intensity/0=4"});
  EXPECT_EQ(other.code, 0);
  EXPECT_THAT(other.err, HasSubstr("was not baked from this scene"));
}

}  // namespace
}  // namespace brume
