#include "cache/cache_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstring>

#include "cache/cache_copy.h"
#include "cache/irradiance_cache.h"
#include "core/error.h"
#include "sample_records.h"

namespace brume {
namespace {

using testing::HasSubstr;

TEST(CacheFile, ReturnsWhatWasWrittenBitForBit) {
  const ScratchFolder folder;
  const std::vector<SurfaceRecord> a = sample_records(20000, 1, 0), b = sample_records(3, 1, 1),
                                   c = sample_records(8192, 2, 0);
  write_batches(folder / "a.irc", {a, {}, b, c});
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
  write_batches(folder / "a.irc", {sample_records(9000)});
  write_batches(folder / "other.irc", {sample_records(9000)});
  EXPECT_EQ(read_bytes(folder / "a.irc"), read_bytes(folder / "other.irc"));
}

TEST(CacheFile, AnEmptyCacheIsComplete) {
  const ScratchFolder folder;
  write_batches(folder / "a.irc", {});
  const CacheOpening opening = open_cache(folder / "a.irc", {});
  EXPECT_EQ(opening.state, CacheState::Loaded) << opening.reason;
  EXPECT_TRUE(opening.contents.records.empty());
}

TEST(CacheFile, ItsHeaderCanBeReadByPeople) {
  const ScratchFolder folder;
  write_batches(folder / "a.irc", {sample_records(10)});
  const std::string head = read_bytes(folder / "a.irc").substr(0, 4096);
  EXPECT_THAT(head, HasSubstr(sample_header().settings));
  EXPECT_THAT(head, HasSubstr("brume test"));
  EXPECT_THAT(head, HasSubstr("irradiance"));
}

// What every released version wrote stays readable: tests/golden/cache_vX_Y.irc, 100 records each.
std::vector<SurfaceRecord> read_golden(const std::string& name, CacheHeader* header = nullptr) {
  const auto golden = std::filesystem::path(BRUME_SOURCE_DIR) / "tests/golden" / name;
  const CacheOpening opening = open_cache(golden, sample_header().fingerprint);
  EXPECT_EQ(opening.state, CacheState::Loaded) << opening.reason;
  const std::vector<SurfaceRecord>& records = opening.contents.records;
  EXPECT_EQ(records.size(), 100u);
  if (records.size() != 100) return records;
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
  if (header) *header = opening.contents.header;
  return records;
}

TEST(CacheFile, EarlierVersionsStayReadable) {
  CacheHeader header;
  read_golden("cache_v1.irc", &header);
  EXPECT_EQ(header.format_minor, 0);
  EXPECT_EQ(header.shards, ShardSet());
  read_golden("cache_v1_1.irc", &header);
  EXPECT_EQ(header.format_minor, 1);
  EXPECT_EQ(header.shards, sample_shards());
}

// Deep and top records, and some of the medium.
IrradianceCache sample_cache(const VolumeRecords& volume) {
  std::vector<SurfaceRecord> records = sample_records(60, kDeepLayer);
  for (const SurfaceRecord& r : sample_records(40, kTopLayer, 128)) records.push_back(r);
  const Vec3d origin = sample_header().origin;
  return {records, origin, {}, std::make_shared<VolumeCache>(volume, origin)};
}

TEST(CacheFile, ThisVersionStillWritesTheSameBytes) {
  const auto golden = std::filesystem::path(BRUME_SOURCE_DIR) / "tests/golden/cache_v1_2.irc";
  CacheHeader header = sample_header();
  header.shards = sample_shards();
  const ScratchFolder folder;
  write_cache(folder / "a.irc", header, sample_cache(sample_volume_records(20, 1)),
              {kSampleSolve, ""});
  EXPECT_EQ(read_bytes(folder / "a.irc"), read_bytes(golden));
  EXPECT_EQ(open_cache(golden, {}).contents.header.format_minor, 2);
}

TEST(CacheFile, RecordsOfTheMediumComeBackAtEveryOrder) {
  const ScratchFolder folder;
  for (int order = 0; order <= kMaxHarmonicOrder; ++order) {
    VolumeRecords volume = sample_volume_records(9000, order);  // Two blocks, and a wave more.
    const VolumeRecords later = sample_volume_records(70, order, 3);
    for (std::size_t i = 0; i < later.size(); ++i)
      volume.push_back(later.records[i], later.moments_of(i));
    write_cache(folder / "a.irc", sample_header(), sample_cache(volume), kSampleNotes);
    const CacheOpening opening = open_cache(folder / "a.irc", sample_header().fingerprint);
    ASSERT_EQ(opening.state, CacheState::Loaded) << opening.reason;
    EXPECT_EQ(opening.contents.header.volume_order, order);
    EXPECT_TRUE(opening.contents.volume == volume) << order;
    EXPECT_EQ(opening.contents.notes, kSampleNotes);
    write_cache_contents(folder / "b.irc", opening.contents);
    EXPECT_TRUE(read_bytes(folder / "a.irc") == read_bytes(folder / "b.irc"));
  }
}

TEST(CacheFile, AFileCutAfterAnyTopRecordHoldsAllDeepOnes) {
  const ScratchFolder folder;
  const VolumeRecords volume = sample_volume_records(300, 2);
  write_cache(folder / "a.irc", sample_header(), sample_cache(volume), kSampleNotes);
  const std::string whole = read_bytes(folder / "a.irc");
  int cut_in_medium = 0;
  for (std::size_t size = 4096; size < whole.size(); size += 512) {
    write_bytes(folder / "b.irc", whole.substr(0, size));
    const CacheContents held = check_cache(folder / "b.irc").opening.contents;
    ASSERT_LE(held.volume.size(), volume.size());
    cut_in_medium += held.volume.size() == 0;
    if (held.records.empty() || held.records.back().layer() != kTopLayer) continue;
    EXPECT_TRUE(held.volume == volume);
    EXPECT_EQ(held.notes.solve, kSampleSolve);
  }
  EXPECT_GT(cut_in_medium, 3);
}

TEST(CacheFile, NoFaultyRecordOfTheMediumIsWritten) {
  const ScratchFolder folder;
  VolumeRecords volume = sample_volume_records(5, 1);
  volume.moments_of(3)[0].value[1] = -1;
  EXPECT_THROW(write_cache(folder / "a.irc", sample_header(), sample_cache(volume)), Error);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.irc"));
}

TEST(CacheFile, AnotherFingerprintIsStale) {
  const ScratchFolder folder;
  write_batches(folder / "a.irc", {sample_records(10)});
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

TEST(CacheFile, TellsWhichShardsItHolds) {
  const ScratchFolder folder;
  CacheHeader header = sample_header();
  header.shards = sample_shards();
  write_batches(folder / "a.irc", {sample_records(10)}, header);
  const CacheOpening opening = open_cache(folder / "a.irc", {});
  ASSERT_EQ(opening.state, CacheState::Loaded) << opening.reason;
  EXPECT_EQ(opening.contents.header.shards, sample_shards());
  EXPECT_EQ(sample_shards().missing(), (std::vector<std::uint32_t>{1, 2, 3, 5, 6, 7, 8}));
  for (const ShardSet& bad : {ShardSet{1, 3, {3}}, ShardSet{1, 3, {1, 1}}, ShardSet{1, 3, {1, 0}},
                              ShardSet{1, 0, {0}}, ShardSet{1, 4097, {}}}) {
    header.shards = bad;
    EXPECT_EQ(kind_thrown([&] { CacheWriter(folder / "b.irc", header); }), ErrorKind::Internal);
  }
}

TEST(CacheFile, TheLookupOrderComesWithItAndIsChecked) {
  const ScratchFolder folder;
  std::vector<SurfaceRecord> records = sample_records(3000, 1, 0);
  const std::vector<SurfaceRecord> more = sample_records(500, 2, 3);
  records.insert(records.end(), more.begin(), more.end());
  const IrradianceCache cache(records, sample_header().origin);
  write_cache(folder / "a.irc", sample_header(), cache);
  const CacheOpening opening = open_cache(folder / "a.irc", {});
  ASSERT_EQ(opening.state, CacheState::Loaded) << opening.reason;
  ASSERT_EQ(opening.contents.curve_order.size(), 3500u);
  std::vector<std::uint32_t> order = cache.curve_order(1);
  const std::vector<std::uint32_t> second = cache.curve_order(2);
  EXPECT_EQ(order.size(), 3000u);
  order.insert(order.end(), second.begin(), second.end());
  EXPECT_EQ(opening.contents.curve_order, order);

  // Behind valid sums, an order that would lose or invent records.
  const auto state_with = [&](std::size_t layer_1, std::uint32_t value) {
    std::vector<std::uint32_t> bad = cache.curve_order(1);
    bad[layer_1] = value;
    CacheWriter writer(folder / "bad.irc", sample_header());
    writer.seal({records.begin(), records.begin() + 3000});
    writer.seal(more);
    writer.seal_order(1, bad);
    writer.seal_order(2, second);
    writer.finish();
    return open_cache(folder / "bad.irc", {}).state;
  };
  EXPECT_EQ(state_with(7, order[7]), CacheState::Loaded);
  EXPECT_EQ(state_with(7, order[8]), CacheState::Corrupt);  // Twice.
  EXPECT_EQ(state_with(7, 3001), CacheState::Corrupt);      // Of another layer.
  EXPECT_EQ(state_with(7, 3500), CacheState::Corrupt);      // None.
  EXPECT_EQ(state_with(7, 0xfffffffe), CacheState::Corrupt);
  EXPECT_EQ(state_with(7, 0xffffffff), CacheState::Corrupt);  // One too few.
}

TEST(CacheWriter, LeavesNothingBehindWhenAbandoned) {
  const ScratchFolder folder;
  {
    CacheWriter writer(folder / "a.irc", sample_header());
    writer.seal(sample_records(10));
    EXPECT_TRUE(std::filesystem::exists(folder / "a.irc.next"));
  }
  EXPECT_TRUE(folder.is_empty());
}

TEST(CacheWriter, KeepsTheOldFileUntilItFinishes) {
  const ScratchFolder folder;
  write_batches(folder / "a.irc", {sample_records(10)});
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

TEST(CacheWriter, ADeadWriterIsNotInTheWay) {
  const ScratchFolder folder;
  write_batches(folder / "a.irc", {sample_records(5)});
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
  EXPECT_EQ(open_cache(folder / "a.irc", {}).contents.records.size(), 5u);
  write_batches(folder / "a.irc", {sample_records(10)});
  EXPECT_EQ(open_cache(folder / "a.irc", {}).contents.records.size(), 10u);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.irc.part"));
  EXPECT_FALSE(std::filesystem::exists(folder / "a.irc.next"));
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

TEST(CacheWriter, AFullDiskLeavesWhatWasThere) {
  const ScratchFolder folder;
  write_batches(folder / "a.irc", {sample_records(5)});
  const std::vector<SurfaceRecord> first = sample_records(8192),
                                   second = sample_records(8192, 1, 1);
  std::string message;
  {
    CacheWriter writer(folder / "a.irc", sample_header());
    writer.seal(first);
    {
      const FileSizeLimit limit(1'500'000);  // In the middle of the second block.
      EXPECT_EQ(kind_thrown([&] { writer.seal(second); }, &message), ErrorKind::Resource);
    }
    // There is space again, but what the disk holds is no longer known.
    EXPECT_EQ(kind_thrown([&] { writer.seal(second); }), ErrorKind::Resource);
    EXPECT_EQ(kind_thrown([&] { writer.finish(); }), ErrorKind::Resource);
  }
  EXPECT_THAT(message, HasSubstr((folder / "a.irc.next").string()));
  EXPECT_THAT(message, HasSubstr("1048640 bytes at 1052736"));
  EXPECT_EQ(open_cache(folder / "a.irc", {}).contents.records.size(), 5u);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.irc.next"));
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
  write_batches(folder / "long.irc", {}, header);
  EXPECT_EQ(open_cache(folder / "long.irc", {}).contents.header.settings, header.settings);
  header.settings += 'x';
  EXPECT_EQ(kind_thrown([&] { CacheWriter(folder / "b.irc", header); }), ErrorKind::Internal);
  header.settings = "{\n}";
  EXPECT_EQ(kind_thrown([&] { CacheWriter(folder / "b.irc", header); }), ErrorKind::Internal);
  EXPECT_FALSE(std::filesystem::exists(folder / "b.irc.part"));
}

}  // namespace
}  // namespace brume
