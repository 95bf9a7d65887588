// Disks that are full, fail or cannot be written (HARD_CASES T03, T04, T07, T19, T21).
#include <sys/mount.h>
#include <unistd.h>

#include "program_fixture.h"

namespace brume {
namespace {

using testing::HasSubstr;

class Faults : public ProgramTest {
 protected:
  static Circumstances failing(const std::string& call, int number, const std::string& action) {
    return {{"LD_PRELOAD=" BRUME_FAILING_DISK, "FAULT_CALL=" + call,
             "FAULT_NUMBER=" + std::to_string(number), "FAULT_ACTION=" + action},
            {}};
  }
  // Whatever went wrong: there is no cache, the old one or the new one, and a bake that meets no
  // more faults makes what an undisturbed one makes.
  void expect_recovery(const std::vector<std::string>& command, const std::string& what,
                       const std::string& wanted, const std::string& old = "") {
    if (exists("c.irc")) {
      const std::string now = read("c.irc");
      EXPECT_TRUE(now == wanted || (!old.empty() && now == old)) << what;
    }
    EXPECT_EQ(run_program(command), 0) << what << ": " << end_of_err();
    EXPECT_TRUE(read("c.irc") == wanted) << what;
    EXPECT_TRUE(is_tidy("c.irc")) << what;
  }
  void begin_with(const std::string& old) {
    std::filesystem::remove(path("c.irc"));
    if (!old.empty()) write("c.irc", old);
  }
  // What small_bake() makes, and the half of it that one of two shards is.
  void make_small() {
    ASSERT_EQ(run_program(small_bake("small.irc")), 0) << end_of_err();
    ASSERT_EQ(run_program(small_bake("half.irc", {"--shard", "1/2"})), 0);
    small_ = read("small.irc");
    half_ = read("half.irc");
  }

  std::string small_, half_;
};

// T03.
TEST_F(Faults, AFullDiskEndsTheBakeAndKeepsWhatIsSealed) {
  whole();
  for (const rlim_t bytes :
       {rlim_t(2000), rlim_t(50'000), whole().size() / 2, whole().size() - 1}) {
    const Circumstances small{{}, [=] {
                                const struct rlimit limit { bytes, bytes };
                                setrlimit(RLIMIT_FSIZE, &limit);
                              }};
    EXPECT_EQ(run_program(bake("c.irc"), small), 6) << bytes;
    EXPECT_THAT(read("err"), HasSubstr(path("c.irc")));
    EXPECT_THAT(read("err"), HasSubstr("bytes at"));
    EXPECT_FALSE(exists("c.irc"));
    EXPECT_FALSE(exists("c.irc.next"));
    if (bytes > 4096) {
      EXPECT_GE(records_in("c.irc.part"), reported_sealed());
    }
    expect_recovery(bake("c.irc"), "limit of " + std::to_string(bytes), whole());
    std::filesystem::remove(path("c.irc"));
  }
}

TEST_F(Faults, AFullFileSystemEndsTheBakeAndKeepsWhatIsSealed) {
  std::filesystem::create_directory(path("disk"));
  if (geteuid() != 0 || mount("brume", path("disk").c_str(), "tmpfs", 0, "size=320k") != 0)
    GTEST_SKIP() << "no file system may be mounted here";
  whole();
  EXPECT_EQ(run_program(bake("disk/c.irc")), 6);
  EXPECT_THAT(read("err"), HasSubstr("No space left on device"));
  EXPECT_FALSE(exists("disk/c.irc"));
  const std::size_t sealed = records_in("disk/c.irc.part");
  EXPECT_GE(sealed, reported_sealed());
  EXPECT_GT(sealed, 100u);
  EXPECT_EQ(mount("brume", path("disk").c_str(), "tmpfs", MS_REMOUNT, "size=64m"), 0);
  EXPECT_EQ(run_program(bake("disk/c.irc")), 0) << end_of_err();
  EXPECT_TRUE(read("disk/c.irc") == whole());
  EXPECT_EQ(umount(path("disk").c_str()), 0);
}

// T04: each call fails in turn, until there are no more of its kind.
TEST_F(Faults, NoFailingCallPassesForSuccess) {
  make_small();
  for (const auto& [call, action] :
       std::initializer_list<std::pair<const char*, const char*>>{{"write", "EIO"},
                                                                  {"write", "short"},
                                                                  {"sync", "EIO"},
                                                                  {"rename", "EACCES"},
                                                                  {"truncate", "EIO"}}) {
    int faults = 0, unharmed = 0;
    // Seals come by the clock, so a run may have a few calls less than the one before.
    for (int number = 1; unharmed < 3; ++number) {
      ASSERT_LT(number, 100) << call;
      begin_with(number % 2 ? "" : half_);
      const int code =
          run_program(small_bake("c.irc", {"--durable", "power"}), failing(call, number, action));
      const std::string what = std::string(call) + " " + std::to_string(number) + " " + action;
      EXPECT_TRUE(code == 0 || code == 6) << what << ": " << code << end_of_err();
      if (code == 0) {
        EXPECT_TRUE(read("c.irc") == small_) << what;
        ++unharmed;
      } else {
        EXPECT_THAT(read("err"), HasSubstr(".irc")) << what;
        ++faults;
        expect_recovery(small_bake("c.irc"), what, small_, half_);
      }
    }
    EXPECT_EQ(faults > 0, std::string(action) != "short") << call << " " << action;
  }
}

// T21.
TEST_F(Faults, KilledAtTheLastStepsItLeavesTheOldStateOrTheNew) {
  make_small();
  for (const char* call : {"rename", "sync", "unlink", "truncate"})
    for (const char* action : {"kill", "kill_after"})
      for (int number = 1; number <= 2; ++number) {
        begin_with(number % 2 ? half_ : "");
        const int end = run_program(small_bake("c.irc", {"--seal-interval", "9"}),
                                    failing(call, number, action));
        EXPECT_TRUE(end == -SIGKILL || end == 0) << end;
        expect_recovery(small_bake("c.irc"),
                        std::string(call) + " " + action + " " + std::to_string(number), small_,
                        half_);
      }
}

// T07.
TEST_F(Faults, PlacesThatCannotBeWrittenAreRefusedBeforeAnyWork) {
  std::filesystem::create_directory(path("locked"));
  std::filesystem::permissions(path("locked"), std::filesystem::perms(0555));
  std::filesystem::create_directory(path("folder.irc"));
  write("file", "x");
  ASSERT_EQ(symlink("loop.irc", path("loop.irc").c_str()), 0);
  ASSERT_EQ(symlink("link.irc.part", path("link.irc.part").c_str()), 0);
  scene();
  std::filesystem::permissions(folder_, std::filesystem::perms(0777));
  for (const char* file :
       {"none/c.irc", "locked/c.irc", "folder.irc", "file/c.irc", "loop.irc", "link.irc"}) {
    // Permissions bind nobody who is root.
    const Circumstances nobody{{}, [] {
                                 if (geteuid() == 0 && setuid(65534) != 0) _exit(99);
                               }};
    EXPECT_EQ(run_program(endless_bake(file), nobody), 6) << file << end_of_err();
    EXPECT_THAT(read("err"), HasSubstr("error: " + path(file))) << file;
    EXPECT_EQ(reported_sealed(), 0u);
  }
}

// T19.
TEST_F(Faults, WithTooLittleMemoryThereIsNoCorruptFile) {
  make_small();
  int failures = 0;
  for (rlim_t megabytes = 1024; megabytes >= 64; megabytes = megabytes * 3 / 4) {
    const Circumstances poor{{}, [=] {
                               const struct rlimit limit { megabytes << 20, megabytes << 20 };
                               setrlimit(RLIMIT_AS, &limit);
                             }};
    const int code = run_program(small_bake("c.irc", {"-t", "2"}), poor);
    // Not even the program's libraries fit, or one of them threw before the program began.
    const bool has_not_begun = (code == 127 || code == -SIGABRT) && !exists("c.irc.part");
    EXPECT_TRUE(code == 0 || code == 6 || has_not_begun)
        << megabytes << " MiB: " << code << end_of_err();
    failures += code != 0;
    if (exists("c.irc")) {
      EXPECT_TRUE(read("c.irc") == small_) << megabytes;
    }
    std::filesystem::remove(path("c.irc"));
    std::filesystem::remove(path("c.irc.part"));
  }
  EXPECT_GT(failures, 0);
}

}  // namespace
}  // namespace brume
