#include "cache/cache_journal.h"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/parallel.h"
#include "sample_records.h"

namespace brume {
namespace {

using testing::HasSubstr;

const JournalOptions kAtOnce{.seal_interval = std::chrono::milliseconds(0)};

class Journal : public testing::Test {
 protected:
  CacheJournal open(const JournalOptions& options = {}) {
    return {file_, sample_header(), options};
  }
  void fill(std::size_t count, const JournalOptions& options = {}) {
    CacheJournal journal(file_, sample_header(), options);
    for (const SurfaceRecord& record : sample_records(count)) journal.add(record);
  }
  std::size_t found(const CacheJournal& journal, std::size_t count) {
    std::size_t n = 0;
    for (const SurfaceRecord& record : sample_records(count))
      if (const SurfaceRecord* same = journal.find(1, record.key))
        n += std::memcmp(same, &record, sizeof record) == 0;
    return n;
  }

  ScratchFolder folder_;
  std::filesystem::path file_ = folder_ / "a.irc", part_ = folder_ / "a.irc.part";
};

TEST_F(Journal, FindsWhatAnotherRunAdded) {
  fill(20000);
  const CacheJournal journal(file_, sample_header(), {});
  EXPECT_EQ(found(journal, 20000), 20000u);
  EXPECT_EQ(journal.find(2, sample_records(1)[0].key), nullptr) << "of another layer";
  EXPECT_EQ(journal.find(1, 3), nullptr);
}

TEST_F(Journal, NotesComeBackWithRecordsAndWithout) {
  const SurfaceRecord record = sample_records(1)[0];
  const std::vector<unsigned char> of_record(200, 7), large(3'000'000, 9);
  {
    CacheJournal journal(file_, sample_header(), {});
    journal.add(record, of_record);
    journal.add_note(42, large);
  }
  const CacheJournal journal(file_, sample_header(), {});
  const auto begins_with = [&](std::uint64_t key, const std::vector<unsigned char>& note) {
    const auto found = journal.find_note(key);
    return found.size() >= note.size() && std::equal(note.begin(), note.end(), found.begin());
  };
  EXPECT_NE(journal.find(1, record.key), nullptr);
  EXPECT_TRUE(begins_with(record.key, of_record));
  EXPECT_TRUE(begins_with(42, large));
  EXPECT_TRUE(journal.find_note(43).empty());
}

TEST_F(Journal, GoesOnWithThePartOfAnother) {
  fill(100);
  {
    CacheJournal journal(file_, sample_header(), {});
    for (const SurfaceRecord& record : sample_records(50, 2, 7)) journal.add(record);
  }
  const CacheJournal journal(file_, sample_header(), {});
  EXPECT_EQ(found(journal, 100), 100u);
  EXPECT_NE(journal.find(2, sample_records(50, 2, 7)[49].key), nullptr);
}

TEST_F(Journal, ManyThreadsMayAdd) {
  const std::vector<SurfaceRecord> records = sample_records(5000);
  {
    CacheJournal journal(file_, sample_header(), kAtOnce);
    parallel_for(7, records.size(), 1, [&](std::size_t i) { journal.add(records[i]); });
  }
  EXPECT_EQ(found(CacheJournal(file_, sample_header(), {}), 5000), 5000u);
}

TEST_F(Journal, WhatWasSaidToBeSealedOutlivesAKill) {
  int reports[2];
  ASSERT_EQ(::pipe(reports), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    JournalOptions options = kAtOnce;
    options.on_sealed = [&](std::size_t count) {
      [[maybe_unused]] const auto ignored = ::write(reports[1], &count, sizeof count);
      if (count >= 300) ::raise(SIGKILL);
    };
    CacheJournal journal(file_, sample_header(), options);
    for (const SurfaceRecord& record : sample_records(1000)) journal.add(record);
    ::_exit(1);
  }
  ::close(reports[1]);
  std::size_t sealed = 0;
  while (::read(reports[0], &sealed, sizeof sealed) > 0) {
  }
  ::close(reports[0]);
  int status = 0;
  ::waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
  EXPECT_GE(sealed, 300u);
  const CacheJournal journal(file_, sample_header(), {});
  EXPECT_EQ(found(journal, sealed), sealed);
}

TEST_F(Journal, APartCutAnywhereKeepsItsLongestValidPrefix) {
  fill(40, kAtOnce);
  const std::string whole = read_bytes(part_);
  ASSERT_EQ(whole.size(), 4096 + 40 * 192u);
  for (std::size_t size = 0; size < whole.size(); size += 61) {
    write_bytes(part_, whole.substr(0, size));
    CacheJournal journal(file_, sample_header(), {});
    const std::size_t kept = size < 4096 ? 0 : (size - 4096) / 192;
    ASSERT_EQ(found(journal, 40), kept) << size;
    // The tail is gone, so what follows joins the chain.
    journal.add(sample_records(1, 2)[0]);
    journal.seal();
    ASSERT_EQ(check_cache(part_).opening.contents.records.size(), kept + 1) << size;
  }
}

TEST_F(Journal, OfOtherRecordsIsRefusedUntouched) {
  fill(10);
  const std::string before = read_bytes(part_);
  CacheHeader other = sample_header();
  other.fingerprint.words[0] ^= 1;
  std::string message;
  EXPECT_EQ(kind_thrown([&] { CacheJournal(file_, other, {}); }, &message),
            ErrorKind::InvalidInput);
  EXPECT_THAT(message, HasSubstr("stale"));
  EXPECT_EQ(read_bytes(part_), before);
  write_bytes(part_, std::string(5000, 'x'));
  EXPECT_EQ(kind_thrown([&] { open(); }, &message), ErrorKind::InvalidInput);
  EXPECT_THAT(message, HasSubstr("not a brume cache"));
  EXPECT_EQ(read_bytes(part_), std::string(5000, 'x'));
  CacheJournal(file_, other, {.starts_anew = true}).add(sample_records(1)[0]);
  EXPECT_EQ(check_cache(part_).opening.contents.records.size(), 1u);
}

TEST_F(Journal, OneWithoutRecordsLeavesNothingBehind) {
  { const CacheJournal journal(file_, sample_header(), {}); }
  EXPECT_TRUE(folder_.is_empty());
  fill(3);
  { CacheJournal(file_, sample_header(), {}).remove(); }
  EXPECT_TRUE(folder_.is_empty());
}

TEST_F(Journal, HoldsTheLockForItsCache) {
  const CacheJournal journal(file_, sample_header(), {});
  EXPECT_EQ(kind_thrown([&] { open(); }), ErrorKind::Stopped);
  EXPECT_EQ(kind_thrown([&] { CacheWriter(file_, sample_header()); }), ErrorKind::Stopped);
  CacheWriter writer(file_, sample_header(), &journal);
  writer.seal(sample_records(10));
  writer.finish();
  EXPECT_EQ(open_cache(file_, {}).state, CacheState::Loaded);
  EXPECT_EQ(kind_thrown([&] { open(); }), ErrorKind::Stopped) << "and holds it still";
}

TEST_F(Journal, OutlivesACacheWrittenUnderItsName) {
  fill(10);
  write_batches(file_, {sample_records(5)});
  EXPECT_EQ(found(CacheJournal(file_, sample_header(), {}), 10), 10u);
}

TEST_F(Journal, AFullDiskKeepsWhatIsSealed) {
  const std::vector<SurfaceRecord> records = sample_records(1000);
  {
    CacheJournal journal(file_, sample_header(), kAtOnce);
    std::size_t i = 0;
    for (; i < 200; ++i) journal.add(records[i]);
    std::string message;
    {
      const FileSizeLimit limit(60'000);
      EXPECT_EQ(kind_thrown(
                    [&] {
                      for (; i < records.size(); ++i) journal.add(records[i]);
                    },
                    &message),
                ErrorKind::Resource);
    }
    EXPECT_THAT(message, HasSubstr(part_.string() + ": cannot write 192 bytes at 59"));
    EXPECT_EQ(kind_thrown([&] { journal.add(records[i]); }), ErrorKind::Resource);
  }
  const CacheJournal journal(file_, sample_header(), {});
  EXPECT_EQ(found(journal, 1000), (60'000u - 4096) / 192);
}

TEST_F(Journal, PlacesThatCannotBeWrittenAreRefusedAtOnce) {
  std::filesystem::create_directory(folder_ / "taken.irc");
  ASSERT_EQ(::mkfifo((folder_ / "fifo.irc.part").c_str(), 0600), 0);
  ASSERT_EQ(::symlink("loop.irc", (folder_ / "loop.irc").c_str()), 0);
  ASSERT_EQ(::symlink("link.irc.part", (folder_ / "link.irc.part").c_str()), 0);
  write_bytes(folder_ / "file", "x");
  for (const auto& file : {folder_ / "none" / "a.irc", folder_ / "taken.irc", folder_ / "fifo.irc",
                           folder_ / "loop.irc", folder_ / "link.irc", folder_ / "file" / "a.irc"})
    EXPECT_EQ(kind_thrown([&] { CacheJournal(file, sample_header(), {}); }), ErrorKind::Resource)
        << file;
}

TEST_F(Journal, ItsPartIsNoCache) {
  fill(10);
  EXPECT_EQ(open_cache(part_, {}).state, CacheState::Corrupt);
  EXPECT_TRUE(has_part(file_));
  EXPECT_FALSE(has_part(folder_ / "b.irc"));
}

}  // namespace
}  // namespace brume
