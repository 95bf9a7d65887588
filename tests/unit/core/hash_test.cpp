#include "core/hash.h"

#include <gtest/gtest.h>

namespace brume {
namespace {

TEST(Hash64, MatchesThePublishedValueOfTheEmptyInput) {
  // XXH3_64bits of nothing, seed 0 (xxHash specification).
  EXPECT_EQ(hash64("", 0), 0x2d06800538d394c2ULL);
  EXPECT_NE(hash64("a", 1), hash64("b", 1));
}

TEST(Fingerprint, IsAFunctionOfTheSequence) {
  const auto of = [](auto... values) {
    FingerprintBuilder b;
    (b.add(values), ...);
    return b.finish();
  };
  EXPECT_EQ(of(1, 2.0, std::string_view("x")), of(1, 2.0, std::string_view("x")));
  EXPECT_NE(of(1, 2), of(2, 1));
  EXPECT_NE(of(1.0f), of(1.0));
}

TEST(Fingerprint, ValuesDoNotRunIntoEachOther) {
  FingerprintBuilder a, b, c;
  a.add(std::string_view("ab")).add(std::string_view("c"));
  b.add(std::string_view("a")).add(std::string_view("bc"));
  c.add(std::string_view("abc"));
  EXPECT_NE(a.finish(), b.finish());
  EXPECT_NE(a.finish(), c.finish());
  FingerprintBuilder none, empty;
  empty.add(std::vector<int>{});
  EXPECT_NE(none.finish(), empty.finish());
}

TEST(Fingerprint, FinishDoesNotEndIt) {
  FingerprintBuilder b;
  b.add(1);
  const Fingerprint first = b.finish();
  EXPECT_EQ(b.finish(), first);
  b.add(2);
  EXPECT_NE(b.finish(), first);
}

TEST(Fingerprint, ShowsAs32HexDigits) {
  const Fingerprint f{{0x0123456789abcdefULL, 0x1}};
  EXPECT_EQ(f.hex(), "0123456789abcdef0000000000000001");
}

}  // namespace
}  // namespace brume
