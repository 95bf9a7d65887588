#include "cli/progress.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace brume {
namespace {

std::vector<int> percentages(const std::string& text) {
  std::vector<int> found;
  for (std::size_t at = text.find(" %"); at != std::string::npos; at = text.find(" %", at + 1))
    found.push_back(std::stoi(text.substr(text.find_last_of(" ", at - 1) + 1)));
  return found;
}

std::string shown(ProgressStyle style, bool is_terminal, const std::vector<double>& fractions,
                  int verbosity = 0) {
  std::ostringstream out, err;
  CommandContext context{out, err, {}};
  context.progress = style;
  context.err_is_terminal = is_terminal;
  context.verbosity = verbosity;
  {
    Progress progress(context);
    for (const double f : fractions) progress.update("gather", f);
    progress.finish();
  }
  EXPECT_EQ(out.str(), "");
  return err.str();
}

TEST(Progress, NeverFallsAndReachesAHundred) {
  const double nan = std::nan("");
  for (const ProgressStyle style : {ProgressStyle::Plain, ProgressStyle::Bar}) {
    const std::string text = shown(style, true, {0, 0.3, nan, 0.1, 0.72, -1, INFINITY, 0.5});
    const auto seen = percentages(text);
    ASSERT_FALSE(seen.empty()) << text;
    EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end())) << text;
    EXPECT_EQ(seen.back(), 100) << text;
    EXPECT_EQ(text.find("nan"), std::string::npos);
  }
}

TEST(Progress, ABarIsForTerminals) {
  EXPECT_NE(shown(ProgressStyle::Bar, true, {0.5}).find('\r'), std::string::npos);
  EXPECT_EQ(shown(ProgressStyle::Bar, false, {0.5}).find('\r'), std::string::npos);
  EXPECT_EQ(shown(ProgressStyle::Auto, false, {0.5}).find('\r'), std::string::npos);
}

TEST(Progress, QuietAndNoneSayNothing) {
  EXPECT_EQ(shown(ProgressStyle::None, true, {0.1, 0.9}), "");
  EXPECT_EQ(shown(ProgressStyle::Plain, true, {0.1, 0.9}, -1), "");
}

TEST(Progress, EachStageReachesAHundredBeforeTheNext) {
  std::ostringstream out, err;
  CommandContext context{out, err, {}};
  context.progress = ProgressStyle::Plain;
  Progress progress(context);
  progress.update("place", 0.4);
  progress.update("gather", 0.1);
  EXPECT_NE(err.str().find("place: 100 %\ngather"), std::string::npos) << err.str();
}

}  // namespace
}  // namespace brume
