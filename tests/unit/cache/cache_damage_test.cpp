// What a damaged, crafted or foreign file can do to a reader: nothing, but for being refused.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>

#include "cache/cache_file.h"
#include "cache/irradiance_cache.h"
#include "core/hash.h"
#include "sample_records.h"

namespace brume {
namespace {

// A sanitizer's own memory would drown what the reader takes.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kMemoryIsOurs = false;
#else
constexpr bool kMemoryIsOurs = true;
#endif

constexpr std::size_t kHeader = 4096, kBlockHeader = 64, kRecord = sizeof(SurfaceRecord);

template <typename T>
void put(std::string& bytes, std::size_t at, const T& value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}
// Makes the sums right again, as an attacker would.
void seal_header(std::string& bytes) { put(bytes, kHeader - 8, hash64(bytes.data(), kHeader - 8)); }
void seal_block(std::string& bytes, std::size_t at) {
  put(bytes, at + 56, hash64(bytes.data() + at, 56));
}

class CacheDamage : public testing::Test {
 protected:
  // Blocks of 5, 3 and 4 records.
  std::string write(const CacheHeader& header, std::uint64_t seed) {
    CacheWriter writer(file_, header);
    writer.seal(sample_records(5, 1, 0, seed));
    writer.seal(sample_records(3, 1, 1, seed));
    writer.seal(sample_records(4, 2, 0, seed));
    writer.finish();
    return read_bytes(file_);
  }
  CacheOpening open(const std::string& bytes) {
    write_bytes(file_, bytes);
    return open_cache(file_, std::nullopt);
  }
  CacheState state(const std::string& bytes) { return open(bytes).state; }

  static constexpr std::size_t kCounts[3] = {5, 3, 4};
  static std::size_t block_at(std::size_t i) {
    std::size_t at = kHeader;
    for (std::size_t k = 0; k < i; ++k) at += kBlockHeader + kCounts[k] * kRecord;
    return at;
  }
  static std::string block(const std::string& bytes, std::size_t i) {
    return bytes.substr(block_at(i), block_at(i + 1) - block_at(i));
  }

  ScratchFolder folder_;
  std::filesystem::path file_ = folder_ / "a.irc";
  std::string good_ = write(sample_header(), 1);
};

TEST_F(CacheDamage, TruncationAtAnyByteKeepsTheLongestValidPrefix) {
  ASSERT_EQ(state(good_), CacheState::Loaded);
  ASSERT_EQ(good_.size(), block_at(3) + 3 * 32 + 128);
  const std::vector<SurfaceRecord> all = open_cache(file_, {}).contents.records;
  write_bytes(file_, good_);
  for (std::size_t size = good_.size(); size-- > 0;) {
    ASSERT_EQ(::truncate(file_.c_str(), static_cast<off_t>(size)), 0);
    const CacheCheck check = check_cache(file_);
    ASSERT_EQ(check.opening.state, CacheState::Corrupt) << size;
    ASSERT_FALSE(check.opening.reason.empty());
    ASSERT_EQ(check.file_bytes, size);
    std::size_t blocks = 0, records = 0;
    while (blocks < 3 && block_at(blocks + 1) <= size) records += kCounts[blocks++];
    ASSERT_EQ(check.opening.contents.sealed_blocks, blocks) << size;
    ASSERT_EQ(check.opening.contents.records.size(), records) << size;
    if (records > 0) {
      ASSERT_EQ(std::memcmp(check.opening.contents.records.data(), all.data(), records * kRecord), 0);
    }
    ASSERT_EQ(check.valid_bytes, size < kHeader ? 0 : block_at(blocks)) << size;
    ASSERT_FALSE(check.opening.contents.is_complete);
  }
}

TEST_F(CacheDamage, EveryFlippedBitIsFound) {
  RandomStream random(21);
  std::fstream file(file_, std::ios::binary | std::ios::in | std::ios::out);
  for (int i = 0; i < 10000; ++i) {
    const std::uint64_t bit = random.bits() % (good_.size() * 8);
    const auto at = static_cast<std::ptrdiff_t>(bit / 8);
    const char flipped = static_cast<char>(good_[bit / 8] ^ (1 << bit % 8));
    file.seekp(at).put(flipped).flush();
    const CacheOpening opening = open_cache(file_, std::nullopt);
    file.seekp(at).put(good_[bit / 8]).flush();
    ASSERT_NE(opening.state, CacheState::Loaded) << "bit " << bit;
    ASSERT_EQ(opening.reason.find('\n'), std::string::npos);
    ASSERT_FALSE(opening.reason.empty());
  }
  EXPECT_EQ(open_cache(file_, std::nullopt).state, CacheState::Loaded);
}

// T08 and T09 on a file as bakes write them, of two blocks and the lookup order.
TEST_F(CacheDamage, ACacheWithItsLookupOrderIsNoLessSafe) {
  const IrradianceCache cache(sample_records(9000), sample_header().origin);
  write_cache(file_, sample_header(), cache);
  const std::string good = read_bytes(file_);
  RandomStream random(22);
  std::fstream file(file_, std::ios::binary | std::ios::in | std::ios::out);
  // Every bit of the last 40,000 bytes would take minutes: the order, index and footer lie there.
  for (int i = 0; i < 10000; ++i) {
    const std::uint64_t range = i % 2 ? good.size() : 40'000;
    const std::uint64_t bit = good.size() * 8 - 1 - random.bits() % (range * 8);
    const auto at = static_cast<std::ptrdiff_t>(bit / 8);
    file.seekp(at).put(static_cast<char>(good[bit / 8] ^ (1 << bit % 8))).flush();
    const CacheState state = open_cache(file_, std::nullopt).state;
    file.seekp(at).put(good[bit / 8]).flush();
    ASSERT_NE(state, CacheState::Loaded) << "bit " << bit;
  }
  ASSERT_EQ(open_cache(file_, std::nullopt).state, CacheState::Loaded);
  const std::size_t ends[] = {kHeader, kHeader + kBlockHeader + 8192 * kRecord,
                              kHeader + 2 * kBlockHeader + 9000 * kRecord};
  for (int i = 3000; i-- > 0;) {
    const std::size_t size =
        i < 9 ? ends[i / 3] + static_cast<std::size_t>(i % 3) - 1 : random.bits() % good.size();
    write_bytes(file_, good.substr(0, size));
    const CacheCheck check = check_cache(file_);
    ASSERT_EQ(check.opening.state, CacheState::Corrupt);
    ASSERT_EQ(check.opening.contents.records.size(), size < ends[1]   ? 0u
                                                     : size < ends[2] ? 8192u
                                                                      : 9000u)
        << size;
  }
}

TEST_F(CacheDamage, MovedBlocksAreFound) {
  const std::string head = good_.substr(0, kHeader), tail = good_.substr(block_at(3));
  const std::string a = block(good_, 0), b = block(good_, 1), c = block(good_, 2);
  EXPECT_EQ(state(head + a + b + c + tail), CacheState::Loaded);
  EXPECT_EQ(state(head + a + c + b + tail), CacheState::Corrupt);
  EXPECT_EQ(state(head + b + a + c + tail), CacheState::Corrupt);
  EXPECT_EQ(state(head + a + a + b + c + tail), CacheState::Corrupt);
  EXPECT_EQ(state(head + a + b + b + tail), CacheState::Corrupt);
  EXPECT_EQ(state(head + a + c + tail), CacheState::Corrupt);
  EXPECT_EQ(state(head + b + c + tail), CacheState::Corrupt);
}

TEST_F(CacheDamage, BlocksOfAnotherFileAreFound) {
  CacheHeader other_header = sample_header();
  other_header.fingerprint.words[0] ^= 1;
  for (const std::string& other : {write(other_header, 1), write(sample_header(), 2)}) {
    ASSERT_EQ(other.size(), good_.size());
    for (std::size_t i = 0; i < 3; ++i) {
      std::string bytes = good_;
      bytes.replace(block_at(i), block(other, i).size(), block(other, i));
      EXPECT_EQ(state(bytes), CacheState::Corrupt) << i;
    }
    EXPECT_EQ(state(good_.substr(0, block_at(3)) + other.substr(block_at(3))), CacheState::Corrupt);
    EXPECT_EQ(state(good_.substr(0, block_at(2)) + other.substr(block_at(2))), CacheState::Corrupt);
  }
}

TEST_F(CacheDamage, ZeroTailsAndTrailingBytesAreFound) {
  for (std::size_t from : {kHeader, block_at(1), block_at(1) + 100, block_at(3), good_.size() - 1}) {
    std::string bytes = good_;
    std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(from), bytes.end(), '\0');
    EXPECT_EQ(state(bytes), CacheState::Corrupt) << from;
  }
  EXPECT_EQ(state(good_ + '\0'), CacheState::Corrupt);
  EXPECT_EQ(state(good_ + good_), CacheState::Corrupt);
  EXPECT_EQ(state(good_ + std::string(100000, 'x')), CacheState::Corrupt);
  EXPECT_EQ(state(good_.substr(0, block_at(3)) + std::string(5, '\0')), CacheState::Corrupt);
}

TEST_F(CacheDamage, TransfersAsTextAreRecognised) {
  const auto replaced = [&](const std::string& from, const std::string& to) {
    std::string bytes = good_;
    for (std::size_t at = 0; (at = bytes.find(from, at)) != std::string::npos; at += to.size())
      bytes.replace(at, from.size(), to);
    return bytes;
  };
  std::string seven_bits = good_;
  for (char& c : seven_bits) c = static_cast<char>(c & 0x7f);
  for (const std::string& bytes :
       {replaced("\r\n", "\n"), replaced("\n", "\r\n"), replaced("\n", "\r"), replaced("\r", "\n"),
        replaced("\r", ""), replaced("\n", ""), seven_bits}) {
    const CacheOpening opening = open(bytes);
    EXPECT_EQ(opening.state, CacheState::Corrupt) << opening.reason;
    EXPECT_NE(opening.reason.find("as text"), std::string::npos) << opening.reason;
  }
}

TEST_F(CacheDamage, OtherFilesAreForeign) {
  EXPECT_EQ(state("{\"name\": \"a scene\"}"), CacheState::Foreign);
  EXPECT_EQ(state(std::string(10000, '\0')), CacheState::Foreign);
  EXPECT_EQ(state("\x89PNG\r\n\x1a\n and so on"), CacheState::Foreign);
  EXPECT_EQ(state(""), CacheState::Corrupt);  // A cache of which nothing is left, if any.
}

TEST_F(CacheDamage, ValuesOutOfRangeAreFoundBehindValidSums) {
  const auto with_bad = [&](std::size_t offset, float value) {
    std::string bytes = good_;
    put(bytes, block_at(2) + kBlockHeader + 2 * kRecord + offset, value);
    put(bytes, block_at(2) + 48, hash64(bytes.data() + block_at(2) + kBlockHeader, 4 * kRecord));
    seal_block(bytes, block_at(2));
    return bytes;
  };
  const float nan = std::nanf(""), infinity = std::numeric_limits<float>::infinity();
  // In the middle of the chain the next block and the footer would have to be made anew: cut them off.
  for (const auto& [offset, value] : std::initializer_list<std::pair<std::size_t, float>>{
           {offsetof(SurfaceRecord, position), nan},       {offsetof(SurfaceRecord, gradient) + 32, infinity},
           {offsetof(SurfaceRecord, rotational), -infinity}, {offsetof(SurfaceRecord, normal), 3},
           {offsetof(SurfaceRecord, irradiance), -1},      {offsetof(SurfaceRecord, radius), 0},
           {offsetof(SurfaceRecord, radius) + 4, -2},      {offsetof(SurfaceRecord, error), -1},
           {offsetof(SurfaceRecord, media_share), 2},      {offsetof(SurfaceRecord, axis), nan}}) {
    const CacheOpening opening = open(with_bad(offset, value).substr(0, block_at(3)));
    EXPECT_EQ(opening.state, CacheState::Corrupt);
    EXPECT_NE(opening.reason.find("record 10"), std::string::npos) << opening.reason;
    const CacheCheck check = check_cache(file_);
    EXPECT_EQ(check.bad_records, 1u);
    EXPECT_EQ(check.opening.contents.records.size(), 12u);
  }
  EXPECT_EQ(check_cache(file_).valid_bytes, block_at(3));
}

struct Crafted {
  const char* name;
  CacheState state;
  std::string bytes;
};

TEST_F(CacheDamage, CraftedHeadersAreRefusedInLittleMemory) {
  std::vector<Crafted> crafted;
  const auto header = [&](const char* name, CacheState state, auto&& change) {
    std::string bytes = good_;
    change(bytes);
    seal_header(bytes);
    crafted.push_back({name, state, bytes});
  };
  using enum CacheState;
  header("major 0", Foreign, [](auto& b) { put(b, 8, std::uint16_t(0)); });
  header("major 2", Foreign, [](auto& b) { put(b, 8, std::uint16_t(2)); });
  header("major 65535", Foreign, [](auto& b) { put(b, 8, std::uint16_t(65535)); });
  // The chain starts with the header's sum, so a header that is fine alone is not with these blocks.
  header("newer minor", Corrupt, [](auto& b) { put(b, 10, std::uint16_t(7)); });
  header("big endian", Foreign, [](auto& b) { put(b, 12, 0x04030201u); });
  header("no endian", Foreign, [](auto& b) { put(b, 12, 0x01020305u); });
  for (std::uint32_t size : {0u, 64u, 4097u, 0xffffffffu})
    header("header size", Foreign, [size](auto& b) { put(b, 16, size); });
  for (std::uint32_t count : {0u, 8193u, 0x7fffffffu, 0xffffffffu})
    header("block records", Foreign, [count](auto& b) { put(b, 20, count); });
  for (std::uint32_t size : {0u, 1u, 127u, 192u, 0x80000000u, 0xffffffffu})
    header("record size", Foreign, [size](auto& b) { put(b, 24, size); });
  for (std::uint32_t size : {1u, 65537u, 0xffffffc0u})
    header("size of another kind", Foreign, [size](auto& b) { put(b, 28, size); });
  for (std::uint32_t bits : {1u, 0x80000000u, 0xffffffffu})
    header("required feature", Foreign, [bits](auto& b) { put(b, 40, bits); });
  for (std::uint32_t fields : {0u, 10u, 23u, 0xffffffffu})
    header("fields", Foreign, [fields](auto& b) { put(b, 44, fields); });
  header("other field", Foreign, [](auto& b) { b[128] = 'q'; });
  header("origin", Corrupt, [](auto& b) { put(b, 64, std::nan("")); });
  for (std::uint32_t size : {2537u, 3064u, 0x7fffffffu, 0xffffffffu})
    header("settings", Corrupt, [size](auto& b) { put(b, 88, size); });
  header("settings with line ends", Corrupt, [](auto& b) { b[1030] = '\n'; });
  header("more shards than there may be", Corrupt, [](auto& b) { put(b, 3568, 4097u); });
  header("a shard that is none of them", Corrupt, [](auto& b) {
    put(b, 3568, 3u);
    b[3576] = 8;
  });
  header("shards of nothing", Corrupt, [](auto& b) { b[3576] = 1; });
  header("creator", Corrupt, [](auto& b) { b[100] = '\x1b'; });

  const auto first_block = [&](const char* name, auto&& change) {
    std::string bytes = good_;
    change(bytes);
    seal_block(bytes, kHeader);
    crafted.push_back({name, Corrupt, bytes});
  };
  for (std::uint32_t count : {0u, 4u, 6u, 8192u, 8193u, 0x02000000u, 0x7fffffffu, 0xffffffffu})
    first_block("count", [count](auto& b) { put(b, kHeader + 8, count); });
  for (std::uint64_t both : {~std::uint64_t(0), ~std::uint64_t(0) / kRecord})
    first_block("count and sequence", [both](auto& b) { put(b, kHeader + 8, both); });
  for (int kind : {0, 2, 4, 5, 255})
    first_block("kind", [kind](auto& b) { b[kHeader + 4] = static_cast<char>(kind); });
  first_block("layer", [](auto& b) { b[kHeader + 5] = 9; });
  first_block("wave", [](auto& b) { b[kHeader + 6] = 9; });
  first_block("sequence", [](auto& b) { put(b, kHeader + 12, 1u); });
  first_block("offset", [](auto& b) { put(b, kHeader + 16, 0u); });
  first_block("cumulative", [](auto& b) { put(b, kHeader + 20, 0xffffffffu); });
  first_block("first key", [](auto& b) { put(b, kHeader + 24, ~std::uint64_t(0)); });
  first_block("last key", [](auto& b) { put(b, kHeader + 32, std::uint64_t(0)); });
  EXPECT_GE(crafted.size(), 40u);

  // In a child, so that the peak is its own and a memory limit harms nobody else.
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    struct rusage before {}, after {};
    ::getrusage(RUSAGE_SELF, &before);
    int wrong = 0;
    for (const Crafted& c : crafted) {
      write_bytes(file_, c.bytes);
      const CacheOpening opening = open_cache(file_, std::nullopt);
      if (opening.state != c.state) {
        std::fprintf(stderr, "%s: state %d, %s\n", c.name, static_cast<int>(opening.state),
                     opening.reason.c_str());
        ++wrong;
      }
    }
    // A sparse file claims much and holds nothing.
    write_bytes(file_, good_);
    if (::truncate(file_.c_str(), off_t(1) << 40) != 0 || open_cache(file_, {}).state != Corrupt) ++wrong;
    ::getrusage(RUSAGE_SELF, &after);
    const long grown_kib = after.ru_maxrss - before.ru_maxrss;
    if (kMemoryIsOurs && grown_kib > 16 * 1024) {
      std::fprintf(stderr, "grew by %ld KiB\n", grown_kib);
      ++wrong;
    }
    ::_exit(wrong == 0 ? 0 : 1);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

TEST_F(CacheDamage, UnknownOptionalBlocksAreSkippedAndRequiredOnesRefused) {
  // Kind 2, 192 bytes a record, as a later version may write it behind our blocks.
  const auto with_block = [&](std::uint8_t flags) {
    std::string bytes = good_;
    put(bytes, 28, 192u);
    seal_header(bytes);
    // The chain anew: every block names the header before it.
    std::uint64_t previous = 0;
    std::memcpy(&previous, bytes.data() + kHeader - 8, 8);
    for (std::size_t i = 0; i < 3; ++i) {
      put(bytes, block_at(i) + 40, previous);
      seal_block(bytes, block_at(i));
      std::memcpy(&previous, bytes.data() + block_at(i) + 56, 8);
    }
    const std::size_t at = block_at(3);
    bytes.resize(at);
    bytes += std::string(kBlockHeader + 2 * 192, '\x07');
    std::memcpy(bytes.data() + at, bytes.data() + kHeader, 4);  // Magic.
    bytes[at + 4] = 2;
    bytes[at + 5] = bytes[at + 6] = 0;
    bytes[at + 7] = static_cast<char>(flags);
    put(bytes, at + 8, 2u);
    put(bytes, at + 12, 3u);
    put(bytes, at + 16, static_cast<std::uint32_t>(at / 64));
    put(bytes, at + 20, 12u);
    put(bytes, at + 40, previous);
    put(bytes, at + 48, hash64(bytes.data() + at + kBlockHeader, 2 * 192));
    seal_block(bytes, at);
    return bytes;
  };
  const CacheOpening optional = open(with_block(2));
  EXPECT_EQ(optional.contents.sealed_blocks, 4u) << optional.reason;
  EXPECT_EQ(optional.contents.records.size(), 12u);
  const CacheOpening required = open(with_block(0));
  EXPECT_EQ(required.contents.sealed_blocks, 3u);
  EXPECT_NE(required.reason.find("newer brume"), std::string::npos) << required.reason;
}

}  // namespace
}  // namespace brume
