#include "core/error.h"

#include <gtest/gtest.h>

namespace brume {
namespace {

TEST(Error, KindsHaveTheirExitCodes) {
  EXPECT_EQ(exit_code(ErrorKind::Internal), 1);
  EXPECT_EQ(exit_code(ErrorKind::Usage), 2);
  EXPECT_EQ(exit_code(ErrorKind::InvalidInput), 3);
  EXPECT_EQ(exit_code(ErrorKind::Partial), 4);
  EXPECT_EQ(exit_code(ErrorKind::Threshold), 5);
  EXPECT_EQ(exit_code(ErrorKind::Resource), 6);
  EXPECT_EQ(exit_code(ErrorKind::Stopped), 75);
}

TEST(Error, AssertionsPrintBothOperands) {
  const int a = 3;
  BRUME_ASSERT(a, ==, 3);
  try {
    BRUME_ASSERT(a, >, 4);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.kind(), ErrorKind::Internal);
    EXPECT_NE(std::string(e.what()).find("a > 4 (3 vs 4)"), std::string::npos) << e.what();
  }
}

TEST(Printable, ForeignTextCannotSteerATerminal) {
  EXPECT_EQ(printable("a\x1b[31m\n\x7f"), "a\\x1b[31m\\x0a\\x7f");
  EXPECT_EQ(printable("r\xc3\xa9sum\xc3\xa9"), "r\xc3\xa9sum\xc3\xa9");
  EXPECT_EQ(printable("abcdef", 3), "abc...");
}

}  // namespace
}  // namespace brume
