// What a cache goes through while it is baked: kills, signals, limits, rivals, shards (HARD_CASES
// T01, T02, T05, T06, T18, T20).
#include <sys/stat.h>

#include "core/random.h"
#include "program_fixture.h"

namespace brume {
namespace {

using testing::HasSubstr;

class Durability : public ProgramTest {};

// T01. BRUME_TEST_KILLS=200 for the whole of it.
TEST_F(Durability, KilledAtAnyMomentAndResumedItGivesTheSameBytes) {
  const char* wanted = std::getenv("BRUME_TEST_KILLS");
  const int kills = wanted ? std::atoi(wanted) : 15;
  const auto begin = std::chrono::steady_clock::now();
  whole();
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  RandomStream random(random_key(5, kills));
  int done = 0, finished = 0, torn = 0;
  std::size_t sealed = 0;
  for (std::size_t before = 0; done < kills;) {
    const pid_t pid = start(bake("c.irc", {"-t", std::to_string(1 + done % 3)}));
    std::this_thread::sleep_for(std::chrono::duration<double>(random.uniform() * seconds));
    kill(pid, SIGKILL);
    const int end = end_of(pid);
    ASSERT_TRUE(end == 0 || end == -SIGKILL) << end << ": " << end_of_err();
    done += end != 0;
    if (exists("c.irc")) {
      ASSERT_TRUE(read("c.irc") == whole()) << "after " << done << " kills";
    } else if (exists("c.irc.part")) {
      const CacheCheck check = check_cache(path("c.irc.part"));
      const std::size_t after = check.opening.contents.records.size();
      ASSERT_GE(after, before + reported_sealed());
      ASSERT_EQ(check.bad_records, 0u);
      torn += check.valid_bytes != check.file_bytes;
      sealed = std::max(sealed, after);
      before = after;
    }
    if (end == 0) {
      ++finished;
      ASSERT_TRUE(is_tidy("c.irc"));
      std::filesystem::remove(path("c.irc"));
      before = 0;
    }
  }
  ASSERT_EQ(run_program(bake("c.irc")), 0) << end_of_err();
  EXPECT_TRUE(read("c.irc") == whole());
  EXPECT_TRUE(is_tidy("c.irc"));
  EXPECT_GT(sealed, 100u);
  std::printf(
      "%d kills, %d bakes came to their end, %d torn tails, up to %zu records sealed, 0 lost\n",
      done, finished, torn, sealed);
}

TEST_F(Durability, ASecondBakeGathersNothingThatWasSealed) {
  const pid_t pid = start(bake("c.irc"));
  wait_until_err_has("sealed 300 records");
  kill(pid, SIGKILL);
  end_of(pid);
  const std::size_t sealed = records_in("c.irc.part");
  ASSERT_GE(sealed, 300u);
  ASSERT_EQ(run_program(bake("c.irc", {"--json"})), 0);
  const nlohmann::json rest = nlohmann::json::parse(read("out"));
  ASSERT_EQ(run_program(bake("other.irc", {"--json"})), 0);
  const std::size_t all = nlohmann::json::parse(read("out"))["gathers"];
  EXPECT_EQ(rest["gathers"], all - sealed);
  EXPECT_TRUE(read("c.irc") == whole());
}

TEST_F(Durability, AppendingIsNoLessSafe) {
  const std::vector<std::string> elsewhere{"--cache-mode", "append", "-D",
                                           "/camera/look_at=[0,0.2,1]"};
  write("c.irc", whole());
  ASSERT_EQ(run_program(bake("c.irc", elsewhere)), 0) << end_of_err();
  const std::string both = read("c.irc");
  EXPECT_GT(both.size(), whole().size());
  write("c.irc", whole());
  const pid_t pid = start(bake("c.irc", elsewhere));
  wait_until_err_has("sealed 60 records");
  kill(pid, SIGKILL);
  end_of(pid);
  EXPECT_TRUE(read("c.irc") == whole() || read("c.irc") == both);
  ASSERT_EQ(run_program(bake("c.irc", elsewhere)), 0) << end_of_err();
  EXPECT_TRUE(read("c.irc") == both);
  EXPECT_TRUE(is_tidy("c.irc"));
}

// T02.
TEST_F(Durability, SignalsSealAndLeaveWithinTwoSeconds) {
  for (const int signal : {SIGTERM, SIGINT, SIGUSR1}) {
    const pid_t pid = start(endless_bake("c.irc"));
    wait_until_err_has("sealed 5 records");
    const auto sent = std::chrono::steady_clock::now();
    kill(pid, signal);
    EXPECT_EQ(end_of(pid), 75) << end_of_err();
    EXPECT_LT(std::chrono::steady_clock::now() - sent, std::chrono::seconds(2));
    EXPECT_THAT(read("err"), HasSubstr("stopped by signal " + std::to_string(signal)));
    EXPECT_GE(records_in("c.irc.part"), reported_sealed());
  }
}

TEST_F(Durability, StoppedAnywhereAndResumedItGivesTheSameBytes) {
  ASSERT_EQ(run_program(bake("other.irc", {"--json"})), 0);
  const std::size_t gathers = nlohmann::json::parse(read("out"))["gathers"];
  const std::size_t top = records_in("other.irc") - deep_records_in("other.irc");
  ASSERT_LT(top, gathers);
  int checkpoints = 0;
  // Among first and second gathers of deep records, and among top ones, which come last.
  for (const std::size_t stop : {gathers / 8, gathers / 3, gathers / 2, gathers - top - 20,
                                 gathers - top / 2, gathers - top / 4}) {
    const pid_t pid = start(bake("c.irc"));
    wait_until_err_has("sealed " + std::to_string(stop) + " records");
    kill(pid, SIGTERM);
    const int code = end_of(pid);
    EXPECT_TRUE(code == 75 || code == 0) << code << end_of_err();
    if (exists("c.irc")) {
      ++checkpoints;
      EXPECT_EQ(open_cache(path("c.irc"), {}).state, CacheState::Loaded);
      EXPECT_EQ(brume({"inspect", path("c.irc"), "--deep"}).code, 0);
    }
    EXPECT_EQ(run_program(bake("c.irc")), 0) << end_of_err();
    EXPECT_TRUE(read("c.irc") == whole()) << stop;
    EXPECT_TRUE(is_tidy("c.irc"));
    std::filesystem::remove(path("c.irc"));
  }
  EXPECT_GT(checkpoints, 0);
}

TEST_F(Durability, BeforeAnythingIsSealedASignalLeavesNothing) {
  // While the scene is loaded and the bake begins, at many moments.
  for (int i = 0; i < 12; ++i) {
    const pid_t pid = start(endless_bake("c.irc"));
    std::this_thread::sleep_for(std::chrono::milliseconds(4 * i));
    kill(pid, SIGTERM);
    const int end = end_of(pid);
    if (end == 75) {
      EXPECT_GT(records_in("c.irc.part"), 0u);
      std::filesystem::remove(path("c.irc.part"));
    } else {
      EXPECT_TRUE(end == 128 + SIGTERM || end == -SIGTERM) << end;
      // Killed outright it may leave an empty part, which is in nobody's way.
      EXPECT_TRUE(!exists("c.irc.part") || records_in("c.irc.part") == 0);
    }
    EXPECT_FALSE(exists("c.irc"));
  }
}

TEST_F(Durability, AHangupWritesWhatThereIsAndGoesOn) {
  whole();
  std::vector<std::string> slower = bake("c.irc");
  const pid_t pid = start(slower);
  wait_until_err_has("sealed 600 records");
  kill(pid, SIGHUP);
  EXPECT_EQ(end_of(pid), 0) << end_of_err();
  EXPECT_THAT(read("err"), HasSubstr("records so far"));
  EXPECT_TRUE(read("c.irc") == whole());
  EXPECT_TRUE(is_tidy("c.irc"));
}

TEST_F(Durability, ATimeLimitLeavesAUsablePartOfTheCache) {
  const std::string c = path("c.irc");
  // How long a run takes depends on what else the machine does, so limits begin low and grow. Every
  // run goes on from what the last one kept; deep records come first, and none of them answers.
  ASSERT_EQ(run_program(bake("c.irc", {"--json"})), 0);
  const double seconds = nlohmann::json::parse(read("out"))["seconds"]["bake"];
  std::filesystem::remove(c);
  int code = 75;
  for (double limit = 0.1 * seconds; limit < 20 * seconds && code != 0; limit *= 1.15) {
    code = run_program(bake("c.irc", {"--time-limit", std::to_string(limit)}));
    ASSERT_TRUE(code == 75 || code == 3 || code == 0) << end_of_err();
    if (code != 0) {
      EXPECT_THAT(read("err"), HasSubstr("the time limit of"));
    }
    if (exists("c.irc")) {
      EXPECT_EQ(brume({"inspect", c, "--deep"}).code, 0);
    }
  }
  EXPECT_EQ(code, 0);
  EXPECT_TRUE(read("c.irc") == whole());
}

TEST_F(Durability, ARecordLimitStopsAtTheSamePlaceForAnyThreads) {
  whole();
  const std::size_t total = records_in("whole.irc"), deep = deep_records_in("whole.irc");
  ASSERT_GT(total, deep + 20);
  for (const std::size_t limit :
       {std::size_t(1), deep + (total - deep) / 3, total - 5, total, total + 1}) {
    std::string first;
    for (const char* threads : {"1", "2", "3"}) {
      const int code = run_program(bake("c.irc", {"--record-limit", std::to_string(limit), "-t",
                                                  threads, "--cache-mode", "new"}));
      EXPECT_EQ(code, limit >= total ? 0 : 75) << end_of_err();
      if (limit == 1) {
        // Fewer than the deep records: what was gathered is kept for a higher limit, none of it answers.
        EXPECT_FALSE(exists("c.irc"));
        EXPECT_TRUE(exists("c.irc.part"));
        continue;
      }
      EXPECT_LE(records_in("c.irc"), limit);
      if (code == 75) {
        EXPECT_THAT(read("err"), HasSubstr("the record limit of " + std::to_string(limit)));
      }
      if (first.empty()) first = read("c.irc");
      EXPECT_TRUE(read("c.irc") == first) << threads << " threads, limit " << limit;
    }
    if (limit == total - 5) {
      // Rendered from as it is, and completed.
      EXPECT_EQ(
          run_program({"render", scene(), "-o", path("a.exr"), "--cache", path("c.irc"), "--res",
                       "48x36", "--error", "0.2", "--cache-mode", "read", "--spp", "1"}),
          0)
          << end_of_err();
      EXPECT_EQ(run_program(bake("c.irc")), 0);
      EXPECT_TRUE(read("c.irc") == whole());
    }
    std::filesystem::remove(path("c.irc"));
    std::filesystem::remove(path("c.irc.part"));
  }
}

// T05.
TEST_F(Durability, OneOfManyWritersBakesAndTheOthersAreTurnedAway) {
  for (const int writers : {2, 8}) {
    std::vector<pid_t> pids;
    for (int i = 0; i < writers; ++i) pids.push_back(start(endless_bake("c.irc")));
    // All but one end by themselves, the one when it is told to.
    int turned_away = 0;
    for (int i = 0; i + 1 < writers; ++i) {
      int status = 0;
      const pid_t pid = waitpid(-1, &status, 0);
      turned_away += WIFEXITED(status) && WEXITSTATUS(status) == 75;
      pids.erase(std::find(pids.begin(), pids.end(), pid));
    }
    EXPECT_EQ(turned_away, writers - 1);
    kill(pids[0], SIGKILL);
    end_of(pids[0]);
    std::filesystem::remove(path("c.irc.part"));
  }
}

TEST_F(Durability, ManyTasksForOneCacheMakeTheSameCache) {
  whole();
  std::vector<pid_t> pids;
  for (int i = 0; i < 4; ++i) pids.push_back(start(bake("c.irc")));
  for (const pid_t pid : pids) {
    const int code = end_of(pid);
    EXPECT_TRUE(code == 0 || code == 75) << code;
  }
  EXPECT_TRUE(read("c.irc") == whole());
  EXPECT_TRUE(is_tidy("c.irc"));
}

// T06, and SPEC's shard count and merge order.
TEST_F(Durability, ShardsMergedInAnyOrderAreTheBytesOfOneProcess) {
  for (const std::uint32_t n : {1u, 2u, 5u}) {
    std::vector<std::string> merge{"merge", "-o", path("m.irc")}, reversed = merge;
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::string file = "s" + std::to_string(i) + ".irc";
      ASSERT_EQ(run_program(bake(file, {"--shard", std::to_string(i) + "/" + std::to_string(n),
                                        "-t", std::to_string(1 + i % 3)})),
                0)
          << end_of_err();
      merge.push_back(path(file));
      reversed.insert(reversed.begin() + 3, path(file));
    }
    // The same task again, by somebody else.
    ASSERT_EQ(run_program(bake("again.irc", {"--shard", "0/" + std::to_string(n)})), 0);
    EXPECT_TRUE(read("again.irc") == read("s0.irc"));
    merge.push_back(path("again.irc"));
    ASSERT_EQ(run_program(merge), 0) << end_of_err();
    EXPECT_TRUE(read("m.irc") == whole()) << n;
    ASSERT_EQ(run_program(reversed), 0) << end_of_err();
    EXPECT_TRUE(read("m.irc") == whole()) << n;
    for (const auto& entry : std::filesystem::directory_iterator(folder_))
      if (entry.path().filename().string()[0] == 's' && entry.path().extension() == ".irc")
        std::filesystem::remove(entry.path());
    std::filesystem::remove(path("again.irc"));
  }
}

TEST_F(Durability, SomeShardsMakeACacheThatCanBeCompleted) {
  for (const char* i : {"0", "2"})
    ASSERT_EQ(run_program(bake(std::string("s") + i + ".irc", {"--shard", std::string(i) + "/3"})),
              0);
  ASSERT_EQ(run_program({"merge", path("s2.irc"), path("s0.irc"), "-o", path("m.irc")}), 0);
  EXPECT_THAT(read("err"), HasSubstr("unfinished: missing shard 1/3"));
  const RunResult shown = brume({"inspect", path("m.irc"), "--deep", "--json"});
  EXPECT_EQ(shown.code, 0);
  EXPECT_EQ(shown.json()["shards"]["count"], 3);
  EXPECT_EQ(shown.json()["shards"]["done"], (std::vector<int>{0, 2}));
  EXPECT_GT(shown.json()["unfinished_records"], 0);
  // By the missing shard, by adding its work to the file, or by going on without shards.
  const std::string some = read("m.irc");
  ASSERT_EQ(run_program(bake("s1.irc", {"--shard", "1/3"})), 0);
  ASSERT_EQ(run_program({"merge", path("m.irc"), path("s1.irc"), "-o", path("all.irc")}), 0);
  EXPECT_TRUE(read("all.irc") == whole());
  EXPECT_EQ(run_program(bake("m.irc", {"--shard", "2/3"})), 0);
  EXPECT_TRUE(read("m.irc") == some) << "that shard is there";
  EXPECT_EQ(run_program(bake("m.irc", {"--shard", "1/3"})), 0);
  EXPECT_TRUE(read("m.irc") == whole());
  EXPECT_EQ(run_program(bake("m.irc", {"--shard", "1/3"})), 0);
  EXPECT_TRUE(read("m.irc") == whole()) << "the whole has every shard";
  write("m.irc", some);
  EXPECT_EQ(run_program(bake("m.irc")), 0);
  EXPECT_TRUE(read("m.irc") == whole());
}

TEST_F(Durability, MergeRefusesWhatDoesNotBelongTogether) {
  ASSERT_EQ(run_program(bake("a.irc", {"--shard", "0/2"})), 0);
  ASSERT_EQ(run_program(bake("b.irc", {"--shard", "1/2", "--seed", "2"})), 0);
  EXPECT_EQ(run_program({"merge", path("a.irc"), path("b.irc"), "-o", path("m.irc")}), 3);
  EXPECT_THAT(read("err"), HasSubstr("different scenes or settings"));
  write("b.irc", read("a.irc").substr(0, 5000));
  EXPECT_EQ(run_program({"merge", path("a.irc"), path("b.irc"), "-o", path("m.irc")}), 3);
  EXPECT_EQ(run_program({"merge", path("a.irc"), path("none.irc"), "-o", path("m.irc")}), 3);
  EXPECT_EQ(run_program({"merge", path("a.irc"), "-o", path("none/m.irc")}), 6);
  EXPECT_FALSE(exists("m.irc"));
}

// T18.
TEST_F(Durability, InputsThatChangeDuringABakeDoNotMatter) {
  whole();
  const pid_t pid = start(bake("c.irc"));
  wait_until_err_has("sealed 100 records");
  ASSERT_EQ(truncate(path("room.obj").c_str(), 10), 0);
  ASSERT_EQ(truncate(scene().c_str(), 10), 0);
  EXPECT_EQ(end_of(pid), 0) << end_of_err();
  EXPECT_TRUE(read("c.irc") == whole());
}

// T20.
TEST_F(Durability, SurroundingsLeaveNoTrace) {
  whole();
  const auto close_from = [](int first, int last) {
    return [=] {
      for (int i = first; i <= last; ++i) close(i);
    };
  };
  const std::vector<std::pair<const char*, Circumstances>> table = {
      {"time zone", {{"TZ=Pacific/Kiritimati"}, {}}},
      {"locale", {{"LC_ALL=de_DE.UTF-8", "LANG=de_DE.UTF-8"}, {}}},
      {"umask", {{}, [] { umask(077); }}},
      {"no input", {{}, close_from(0, 0)}},
      {"no output", {{}, close_from(1, 1)}},
      {"no streams", {{}, close_from(0, 2)}},
      {"clock", {{"LD_PRELOAD=" BRUME_FAILING_DISK, "FAULT_ACTION=clock"}, {}}},
  };
  for (const auto& [name, how] : table) {
    EXPECT_EQ(run_program(bake("c.irc"), how), 0) << name << ": " << end_of_err();
    EXPECT_TRUE(read("c.irc") == whole()) << name;
    struct stat status {};
    ASSERT_EQ(stat(path("c.irc").c_str(), &status), 0);
    if (std::string(name) == "umask") {
      EXPECT_EQ(status.st_mode & 0777, 0600u);
    }
    std::filesystem::remove(path("c.irc"));
  }
}

TEST_F(Durability, APartOfOtherSettingsIsRefusedUntouched) {
  const pid_t pid = start(bake("c.irc"));
  wait_until_err_has("sealed 50 records");
  kill(pid, SIGKILL);
  end_of(pid);
  const std::string part = read("c.irc.part");
  EXPECT_EQ(run_program(bake("c.irc", {"--seed", "9"})), 3);
  EXPECT_THAT(read("err"), HasSubstr("c.irc.part: stale"));
  EXPECT_TRUE(read("c.irc.part") == part);
  EXPECT_FALSE(exists("c.irc"));
  EXPECT_EQ(run_program(bake("c.irc", {"--seed", "9", "--cache-mode", "new"})), 0);
  EXPECT_TRUE(is_tidy("c.irc"));
}

}  // namespace
}  // namespace brume
