#include "cache/cache_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstring>

#include "core/error.h"
#include "sample_records.h"

namespace brume {
namespace {

using testing::HasSubstr;

bool same_bits(const std::vector<SurfaceRecord>& a, const std::vector<SurfaceRecord>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0);
}

void write_cache(const std::filesystem::path& file,
                 const std::vector<std::vector<SurfaceRecord>>& batches,
                 const CacheHeader& header = sample_header()) {
  CacheWriter writer(file, header);
  for (const auto& batch : batches) writer.seal(batch);
  writer.finish();
}

template <typename Action>
ErrorKind kind_thrown(Action&& action, std::string* message = nullptr) {
  try {
    action();
  } catch (const Error& error) {
    if (message) *message = error.what();
    return error.kind();
  }
  ADD_FAILURE() << "nothing was thrown";
  return ErrorKind::Internal;
}

TEST(CacheFile, ReturnsWhatWasWrittenBitForBit) {
  const ScratchFolder folder;
  const std::vector<SurfaceRecord> a = sample_records(20000, 1, 0), b = sample_records(3, 1, 1),
                                   c = sample_records(8192, 2, 0);
  write_cache(folder / "a.irc", {a, {}, b, c});
  const CacheOpening opening = open_cache(folder / "a.irc", sample_header().fingerprint);
  ASSERT_EQ(opening.state, CacheState::Loaded) << opening.reason;
  EXPECT_TRUE(opening.contents.is_complete);
  EXPECT_EQ(opening.contents.sealed_blocks, 5u);  // 8192 + 8192 + 3616, 3, 8192.
  std::vector<SurfaceRecord> all = a;
  all.insert(all.end(), b.begin(), b.end());
  all.insert(all.end(), c.begin(), c.end());
  EXPECT_TRUE(same_bits(opening.contents.records, all));
  EXPECT_EQ(opening.contents.header.fingerprint, sample_header().fingerprint);
  EXPECT_EQ(opening.contents.header.origin, sample_header().origin);
  EXPECT_EQ(opening.contents.header.settings, sample_header().settings);
  EXPECT_EQ(opening.contents.header.creator, sample_header().creator);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.irc.part"));
}

TEST(CacheFile, IsAPureFunctionOfItsContents) {
  const ScratchFolder folder;
  write_cache(folder / "a.irc", {sample_records(9000)});
  write_cache(folder / "other.irc", {sample_records(9000)});
  EXPECT_EQ(read_bytes(folder / "a.irc"), read_bytes(folder / "other.irc"));
}

TEST(CacheFile, AnEmptyCacheIsComplete) {
  const ScratchFolder folder;
  write_cache(folder / "a.irc", {});
  const CacheOpening opening = open_cache(folder / "a.irc", {});
  EXPECT_EQ(opening.state, CacheState::Loaded) << opening.reason;
  EXPECT_TRUE(opening.contents.records.empty());
}

TEST(CacheFile, ItsHeaderCanBeReadByPeople) {
  const ScratchFolder folder;
  write_cache(folder / "a.irc", {sample_records(10)});
  const std::string head = read_bytes(folder / "a.irc").substr(0, 4096);
  EXPECT_THAT(head, HasSubstr(sample_header().settings));
  EXPECT_THAT(head, HasSubstr("brume test"));
  EXPECT_THAT(head, HasSubstr("irradiance"));
}

TEST(CacheFile, TheFirstVersionStaysReadable) {
  const std::filesystem::path golden = std::filesystem::path(BRUME_SOURCE_DIR) / "tests/golden/cache_v1.irc";
  const CacheOpening opening = open_cache(golden, sample_header().fingerprint);
  ASSERT_EQ(opening.state, CacheState::Loaded) << opening.reason;
  const std::vector<SurfaceRecord>& records = opening.contents.records;
  ASSERT_EQ(records.size(), 100u);
  EXPECT_EQ(opening.contents.sealed_blocks, 3u);
  EXPECT_EQ(records[0].layer(), 1);
  EXPECT_EQ(records[40].wave(), 1);
  EXPECT_EQ(records[99].layer(), 2);
  // Sines may differ by an ulp between machines; the rest is exact.
  const SurfaceRecord expected = sample_records(40, 1, 1)[7], &read = records[47];
  EXPECT_EQ(read.key, expected.key);
  EXPECT_EQ(read.position[2], expected.position[2]);
  EXPECT_EQ(read.gradient[8], expected.gradient[8]);
  EXPECT_EQ(read.radius[1], expected.radius[1]);
  EXPECT_NEAR(read.normal[1], expected.normal[1], 1e-6);
  // This version still writes the same bytes.
  const ScratchFolder folder;
  const auto part = [&](std::size_t begin, std::size_t end) {
    return std::vector<SurfaceRecord>(records.begin() + static_cast<std::ptrdiff_t>(begin),
                                      records.begin() + static_cast<std::ptrdiff_t>(end));
  };
  write_cache(folder / "a.irc", {part(0, 40), part(40, 80), part(80, 100)}, opening.contents.header);
  EXPECT_EQ(read_bytes(folder / "a.irc"), read_bytes(golden));
}

TEST(CacheFile, AnotherFingerprintIsStale) {
  const ScratchFolder folder;
  write_cache(folder / "a.irc", {sample_records(10)});
  Fingerprint other = sample_header().fingerprint;
  other.words[1] ^= 1;
  const CacheOpening opening = open_cache(folder / "a.irc", other);
  EXPECT_EQ(opening.state, CacheState::Stale);
  EXPECT_THAT(opening.reason, HasSubstr(sample_header().fingerprint.hex()));
  EXPECT_TRUE(opening.contents.records.empty());
}

TEST(CacheFile, WhatIsNoFileIsRefusedWithoutWaiting) {
  const ScratchFolder folder;
  EXPECT_EQ(open_cache(folder / "none.irc", {}).state, CacheState::Missing);
  EXPECT_EQ(open_cache(folder / "none" / "none.irc", {}).state, CacheState::Missing);
  EXPECT_EQ(open_cache(folder / ".", {}).state, CacheState::Foreign);
  ASSERT_EQ(::mkfifo((folder / "fifo").c_str(), 0600), 0);
  EXPECT_EQ(open_cache(folder / "fifo", {}).state, CacheState::Foreign);
  EXPECT_EQ(open_cache("/dev/zero", {}).state, CacheState::Foreign);
  write_bytes(folder / "file", "x");
  EXPECT_EQ(open_cache(folder / "file" / "a.irc", {}).state, CacheState::Missing);
}

TEST(CacheWriter, RemovesItsPartWhenAbandoned) {
  const ScratchFolder folder;
  {
    CacheWriter writer(folder / "a.irc", sample_header());
    writer.seal(sample_records(10));
    EXPECT_TRUE(std::filesystem::exists(folder / "a.irc.part"));
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "a.irc.part"));
  EXPECT_FALSE(std::filesystem::exists(folder / "a.irc"));
}

TEST(CacheWriter, LeavesAValidPrefixWhenAsked) {
  const ScratchFolder folder;
  const std::vector<SurfaceRecord> records = sample_records(10000);
  {
    CacheWriter writer(folder / "a.irc", sample_header());
    writer.seal(records);
    writer.leave();
  }
  const CacheOpening part = open_cache(folder / "a.irc.part", sample_header().fingerprint);
  EXPECT_EQ(part.state, CacheState::Corrupt);
  EXPECT_THAT(part.reason, HasSubstr("unfinished"));
  EXPECT_FALSE(part.contents.is_complete);
  EXPECT_TRUE(same_bits(part.contents.records, records));
}

TEST(CacheWriter, KeepsTheOldFileUntilItFinishes) {
  const ScratchFolder folder;
  write_cache(folder / "a.irc", {sample_records(10)});
  const std::string before = read_bytes(folder / "a.irc");
  CacheWriter writer(folder / "a.irc", sample_header());
  writer.seal(sample_records(20));
  EXPECT_EQ(read_bytes(folder / "a.irc"), before);
  writer.finish();
  EXPECT_EQ(open_cache(folder / "a.irc", {}).contents.records.size(), 20u);
}

TEST(CacheWriter, ASecondWriterOfTheSameFileIsTurnedAway) {
  const ScratchFolder folder;
  CacheWriter writer(folder / "a.irc", sample_header());
  std::string message;
  EXPECT_EQ(kind_thrown([&] { CacheWriter(folder / "a.irc", sample_header()); }, &message),
            ErrorKind::Stopped);
  EXPECT_THAT(message, HasSubstr("locked"));
  writer.seal(sample_records(10));
  writer.finish();
  EXPECT_EQ(open_cache(folder / "a.irc", {}).state, CacheState::Loaded);
  CacheWriter again(folder / "a.irc", sample_header());
}

TEST(CacheWriter, TakesOverThePartOfADeadProcess) {
  const ScratchFolder folder;
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    CacheWriter writer(folder / "a.irc", sample_header());
    writer.seal(sample_records(9000, 1, 0, 2));
    ::raise(SIGKILL);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  // What was sealed outlives the kill.
  EXPECT_EQ(open_cache(folder / "a.irc.part", {}).contents.records.size(), 9000u);
  write_cache(folder / "a.irc", {sample_records(10)});
  EXPECT_EQ(open_cache(folder / "a.irc", {}).contents.records.size(), 10u);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.irc.part"));
}

TEST(CacheWriter, OneOfManyProcessesWins) {
  const ScratchFolder folder;
  // Held until every child has tried, so that none can follow another.
  int gate[2];
  ASSERT_EQ(::pipe(gate), 0);
  std::vector<pid_t> children;
  for (int i = 0; i < 8; ++i) {
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      ::close(gate[1]);
      int code = 0;
      char byte;
      try {
        CacheWriter writer(folder / "a.irc", sample_header());
        writer.seal(sample_records(9000));
        while (::read(gate[0], &byte, 1) > 0) {}
        writer.finish();
      } catch (const Error& error) {
        code = exit_code(error.kind());
      }
      ::_exit(code);
    }
    children.push_back(child);
  }
  ::close(gate[0]);
  int turned_away = 0;
  for (int i = 0; i < 7; ++i) {
    int status = 0;
    ASSERT_GT(::waitpid(-1, &status, 0), 0);
    turned_away += WIFEXITED(status) && WEXITSTATUS(status) == 75;
  }
  EXPECT_EQ(turned_away, 7);
  ::close(gate[1]);
  int status = 0;
  ASSERT_GT(::waitpid(-1, &status, 0), 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  EXPECT_EQ(open_cache(folder / "a.irc", {}).contents.records.size(), 9000u);
}

TEST(CacheWriter, AFullDiskLeavesAValidPrefix) {
  const ScratchFolder folder;
  const std::vector<SurfaceRecord> first = sample_records(8192), second = sample_records(8192, 1, 1);
  struct rlimit before {};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  struct sigaction ignore {}, old {};
  ignore.sa_handler = SIG_IGN;
  ::sigaction(SIGXFSZ, &ignore, &old);
  std::string message;
  {
    CacheWriter writer(folder / "a.irc", sample_header());
    writer.seal(first);
    struct rlimit limit = before;
    limit.rlim_cur = 1'500'000;  // In the middle of the second block.
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
    EXPECT_EQ(kind_thrown([&] { writer.seal(second); }, &message), ErrorKind::Resource);
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    // There is space again, but what the disk holds is no longer known.
    EXPECT_EQ(kind_thrown([&] { writer.seal(second); }), ErrorKind::Resource);
    EXPECT_EQ(kind_thrown([&] { writer.finish(); }), ErrorKind::Resource);
  }
  ::sigaction(SIGXFSZ, &old, nullptr);
  EXPECT_THAT(message, HasSubstr((folder / "a.irc.part").string()));
  EXPECT_THAT(message, HasSubstr("1048640 bytes at 1052736"));
  EXPECT_FALSE(std::filesystem::exists(folder / "a.irc"));
  const CacheCheck part = check_cache(folder / "a.irc.part");
  EXPECT_EQ(part.valid_bytes, part.file_bytes);
  EXPECT_TRUE(same_bits(part.opening.contents.records, first));
}

TEST(CacheWriter, RefusesPlacesItCannotWriteToAtOnce) {
  const ScratchFolder folder;
  std::filesystem::create_directory(folder / "taken.irc");
  ASSERT_EQ(::mkfifo((folder / "fifo.irc.part").c_str(), 0600), 0);
  ASSERT_EQ(::symlink("loop.irc.part", (folder / "loop.irc.part").c_str()), 0);
  write_bytes(folder / "file", "x");
  for (const auto& file : {folder / "none" / "a.irc", folder / "taken.irc", folder / "fifo.irc",
                           folder / "loop.irc", folder / "file" / "a.irc"}) {
    std::string message;
    EXPECT_EQ(kind_thrown([&] { CacheWriter(file, sample_header()); }, &message),
              ErrorKind::Resource)
        << file;
    EXPECT_THAT(message, HasSubstr(file.string()));
  }
}

TEST(CacheWriter, RefusesWhatItCouldNotReadBack) {
  const ScratchFolder folder;
  CacheWriter writer(folder / "a.irc", sample_header());
  const auto refused = [&](auto&& change) {
    std::vector<SurfaceRecord> records = sample_records(20);
    change(records);
    return kind_thrown([&] { writer.seal(records); }) == ErrorKind::Internal;
  };
  EXPECT_TRUE(refused([](auto& r) { r[3].gradient[4] = std::nanf(""); }));
  EXPECT_TRUE(refused([](auto& r) { r[3].normal[0] += 0.1f; }));
  EXPECT_TRUE(refused([](auto& r) { r[3].irradiance[1] = -1; }));
  EXPECT_TRUE(refused([](auto& r) { r[3].radius[1] = 0; }));
  EXPECT_TRUE(refused([](auto& r) { r[3].error = -1; }));
  EXPECT_TRUE(refused([](auto& r) { r[3].media_share = 1.5; }));
  EXPECT_TRUE(refused([](auto& r) { std::swap(r[3], r[4]); }));
  EXPECT_TRUE(refused([](auto& r) { r[19].flags = record_flags(1, 1); }));
  EXPECT_TRUE(refused([](auto& r) { r[19].flags = record_flags(2, 0); }));
  writer.seal(sample_records(20));  // None of that harmed the writer.
  writer.finish();
  EXPECT_EQ(kind_thrown([&] { writer.seal(sample_records(20)); }), ErrorKind::Internal);
  EXPECT_EQ(open_cache(folder / "a.irc", {}).contents.records.size(), 20u);

  CacheHeader header = sample_header();
  header.settings = std::string(CacheHeader::kMaxSettingsBytes, 'x');
  write_cache(folder / "long.irc", {}, header);
  EXPECT_EQ(open_cache(folder / "long.irc", {}).contents.header.settings, header.settings);
  header.settings += 'x';
  EXPECT_EQ(kind_thrown([&] { CacheWriter(folder / "b.irc", header); }), ErrorKind::Internal);
  header.settings = "{\n}";
  EXPECT_EQ(kind_thrown([&] { CacheWriter(folder / "b.irc", header); }), ErrorKind::Internal);
  EXPECT_FALSE(std::filesystem::exists(folder / "b.irc.part"));
}

}  // namespace
}  // namespace brume
