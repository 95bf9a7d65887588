// Caches as text: the same bytes come back, and nothing else is taken for one.
#include "exchange/text_records.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "cache/cache_copy.h"
#include "core/error.h"
#include "unit/cache/sample_records.h"

namespace brume {
namespace {

using testing::HasSubstr;

CacheContents read_cache(const std::filesystem::path& file) {
  CacheOpening opening = open_cache(file, std::nullopt);
  EXPECT_EQ(opening.state, CacheState::Loaded) << opening.reason;
  return opening.contents;
}

std::string error_of_reading(const std::filesystem::path& file) {
  try {
    read_text_records(file);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::InvalidInput);
    return error.what();
  }
  return "no error";
}

class TextRecords : public testing::TestWithParam<TextFormat> {
 protected:
  void round_trip(const std::filesystem::path& cache) {
    write_text_records(folder_ / "a.txt", GetParam(), read_cache(cache));
    ASSERT_EQ(text_format_of(folder_ / "a.txt"), GetParam());
    write_cache_contents(folder_ / "back.irc", read_text_records(folder_ / "a.txt"));
    EXPECT_TRUE(read_bytes(cache) == read_bytes(folder_ / "back.irc"));
  }

  ScratchFolder folder_;
};

TEST_P(TextRecords, GiveTheSameCacheBack) {
  CacheWriter writer(folder_ / "a.irc", sample_header());
  for (int layer = 0; layer < 3; ++layer)
    for (const int wave : {0, 1, 128}) writer.seal(sample_records(50, layer, wave));
  writer.finish();
  round_trip(folder_ / "a.irc");
}

TEST_P(TextRecords, KeepTheBatchesOfTheCache) {
  CacheWriter writer(folder_ / "a.irc", sample_header());
  for (std::uint64_t seed = 1; seed <= 3; ++seed) writer.seal(sample_records(20, 1, 4, seed));
  writer.seal(sample_records(9000, 1, 5));
  writer.finish();
  round_trip(folder_ / "a.irc");
}

TEST_P(TextRecords, AnEmptyCacheComesBackEmpty) {
  CacheWriter(folder_ / "a.irc", sample_header()).finish();
  round_trip(folder_ / "a.irc");
}

// Whatever bits a float may have that a record may hold.
TEST_P(TextRecords, GiveEveryFloatBackBitForBit) {
  RandomStream random(5);
  CacheContents contents;
  contents.header = sample_header();
  contents.header.origin = Vec3d(-0.0, 0.1, -1e300 / 3);
  contents.header.settings = "{\"quoted \\\" and \xc3\xa4\":1}";
  contents.records = sample_records(2000);
  const auto any_float = [&] {
    float value;
    do {
      const auto bits = static_cast<std::uint32_t>(random.bits());
      std::memcpy(&value, &bits, sizeof value);
    } while (!std::isfinite(value));
    return value;
  };
  for (SurfaceRecord& record : contents.records) {
    for (float& x : record.position) x = any_float();
    for (float& x : record.gradient) x = any_float();
    for (float& x : record.rotational) x = any_float();
    record.irradiance[0] = std::abs(any_float());
    record.flags |= static_cast<std::uint32_t>(random.bits()) << 16;
  }
  contents.records[0].gradient[0] = -0.0f;
  contents.records[0].gradient[1] = std::numeric_limits<float>::denorm_min();
  contents.records[0].gradient[2] = std::numeric_limits<float>::max();
  contents.records[0].gradient[3] = 16777216.0f;
  write_cache_contents(folder_ / "a.irc", contents);
  round_trip(folder_ / "a.irc");
}

INSTANTIATE_TEST_SUITE_P(AsText, TextRecords,
                         testing::Values(TextFormat::Csv, TextFormat::JsonLines),
                         [](const auto& instance) {
                           return instance.param == TextFormat::Csv ? "Csv" : "JsonLines";
                         });

class BadText : public testing::Test {
 protected:
  void SetUp() override {
    contents_.header = sample_header();
    contents_.records = sample_records(3);
  }
  std::string csv() {
    write_text_records(file_, TextFormat::Csv, contents_);
    return read_bytes(file_);
  }
  std::string with(std::string text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return text.replace(at, from.size(), to);
  }
  std::string error_of(const std::string& text) {
    write_bytes(file_, text);
    return error_of_reading(file_);
  }

  ScratchFolder folder_;
  std::filesystem::path file_ = folder_ / "a.csv";
  CacheContents contents_;
};

TEST_F(BadText, IsRefusedWithItsLine) {
  const std::string good = csv();
  EXPECT_EQ(error_of(good), "no error");
  EXPECT_THAT(error_of(with(good, "\nsurface,", "\nvolume,")),
              HasSubstr("line 3: records of kind"));
  EXPECT_THAT(error_of(with(good, ",1,0,0,", ",256,0,0,")), HasSubstr("line 3: column layer"));
  EXPECT_THAT(error_of(with(good, ",1,0,0,", ",1,0,0,nan,")), HasSubstr("columns, not"));
  EXPECT_THAT(error_of(with(good, ",error,", ",mistake,")), HasSubstr("column error is missing"));
  EXPECT_THAT(error_of(good.substr(0, good.rfind("surface,"))), HasSubstr("holds 2 records"));
  EXPECT_THAT(error_of(good.substr(0, good.size() - 10)), HasSubstr("line 5"));
  EXPECT_THAT(error_of(with(good, "0123456789abcdef", "0123")), HasSubstr("line 1: fingerprint"));
  EXPECT_THAT(error_of("a,b\n1,2\n"), HasSubstr("no cache as text"));
}

TEST_F(BadText, ARecordThatNoCacheHoldsIsRefused) {
  contents_.records[1].radius[0] = -1;
  csv();
  EXPECT_THAT(error_of_reading(file_), HasSubstr("line 4: a radius is not positive"));
}

TEST_F(BadText, SpreadsheetsMayQuoteAndReorderAndEndLinesTheirWay) {
  std::string text = csv(), changed;
  text = with(text, "kind,key", "key,kind");
  for (std::size_t at = text.find("\nsurface,"); at != std::string::npos;
       at = text.find("\nsurface,", at)) {
    const std::string key = text.substr(at + 9, 16);
    text.replace(at, 9 + 16, "\n\"" + key + "\",\"surface\"");
  }
  for (const char c : text) changed += c == '\n' ? std::string("\r\n") : std::string(1, c);
  write_bytes(file_, changed);
  const CacheContents back = read_text_records(file_);
  ASSERT_EQ(back.records.size(), 3u);
  EXPECT_EQ(std::memcmp(back.records.data(), contents_.records.data(), 3 * 128), 0);
}

}  // namespace
}  // namespace brume
