#include "core/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <thread>
#include <vector>

#include "core/error.h"
#include "core/random.h"

namespace brume {
namespace {

std::vector<double> work(int threads, std::size_t grain) {
  std::vector<double> out(1000);
  parallel_for(threads, out.size(), grain, [&](std::size_t i) {
    RandomStream random(random_key(1, i));
    for (std::size_t k = 0; k < i % 17 + 1; ++k) out[i] += std::sin(random.uniform());
  });
  return out;
}

TEST(ParallelFor, ResultsDoNotDependOnThreadsOrGrain) {
  const std::vector<double> expected = work(1, 1);
  for (const int threads : {1, 2, 3, 7})
    for (const std::size_t grain : {0u, 1u, 13u, 5000u})
      EXPECT_EQ(work(threads, grain), expected) << threads << " threads, grain " << grain;
}

TEST(ParallelFor, VisitsEveryIndexOnce) {
  for (const int threads : {1, 2, 3, 7}) {
    std::vector<std::atomic<int>> visits(777);
    parallel_for(threads, visits.size(), 10, [&](std::size_t i) { ++visits[i]; });
    for (const auto& v : visits) EXPECT_EQ(v, 1);
  }
  parallel_for(3, 0, 1, [](std::size_t) { FAIL() << "nothing to do"; });
}

TEST(ParallelFor, FlushesDenormalsOnEveryWorker) {
  for (const int threads : {1, 2, 3, 7}) {
    std::atomic<int> kept{0};
    parallel_for(threads, 500, 1, [&](std::size_t) {
      volatile double tiny = 1e-310;
      volatile double same = tiny * 1.0;
      if (!denormals_are_flushed() || same != 0) ++kept;
    });
    EXPECT_EQ(kept, 0) << threads << " threads";
  }
}

// A thread that did not ask is not flushed, so the test above can fail.
TEST(ParallelFor, AFreshThreadIsNotFlushedUntilItAsks) {
  bool before = true, after = false;
  std::thread([&] {
    // Linux hands the creator's modes on: start from the processor's default.
    __builtin_ia32_ldmxcsr(0x1f80);
    before = denormals_are_flushed();
    parallel_for(1, 1, 1, [](std::size_t) {});
    after = denormals_are_flushed();
  }).join();
  EXPECT_FALSE(before);
  EXPECT_TRUE(after);
}

TEST(ParallelFor, ExceptionsReachTheCaller) {
  for (const int threads : {1, 2, 3, 7}) {
    try {
      parallel_for(threads, 1000, 1, [](std::size_t i) {
        if (i == 500) throw Error(ErrorKind::InvalidInput, "index 500");
      });
      FAIL() << threads << " threads";
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
      EXPECT_STREQ(e.what(), "index 500");
    }
  }
}

TEST(ParallelForSlots, SlotsAreInRangeAndNeverShared) {
  for (const int threads : {1, 2, 3, 7}) {
    std::vector<std::atomic<int>> users(static_cast<std::size_t>(threads));
    std::atomic<int> clashes{0};
    parallel_for_slots(threads, 2000, 1, [&](std::size_t, int slot) {
      ASSERT_GE(slot, 0);
      ASSERT_LT(slot, threads);
      if (users[static_cast<std::size_t>(slot)]++ != 0) ++clashes;
      std::this_thread::yield();
      --users[static_cast<std::size_t>(slot)];
    });
    EXPECT_EQ(clashes, 0);
  }
}

class ThreadCountTest : public testing::Test {
 protected:
  void TearDown() override { unsetenv("SLURM_CPUS_PER_TASK"); }
};

TEST_F(ThreadCountTest, RequestThenSlurmThenAffinity) {
  setenv("SLURM_CPUS_PER_TASK", "5", 1);
  EXPECT_EQ(resolve_thread_count(3), 3);
  EXPECT_EQ(resolve_thread_count(0), 5);
  for (const char* nonsense : {"", "x", "0", "-2"}) {
    setenv("SLURM_CPUS_PER_TASK", nonsense, 1);
    EXPECT_GE(resolve_thread_count(0), 1) << nonsense;
    EXPECT_LE(resolve_thread_count(0), static_cast<int>(std::thread::hardware_concurrency()));
  }
}

TEST_F(ThreadCountTest, ALimitHoldsWhereNoNumberIsAskedFor) {
  setenv("SLURM_CPUS_PER_TASK", "5", 1);
  {
    const ThreadLimit one(1), none(0);
    EXPECT_EQ(resolve_thread_count(0), 1);
    EXPECT_EQ(resolve_thread_count(3), 3);
    std::atomic<int> elsewhere = 0;
    parallel_for(0, 64, 1, [&, main = std::this_thread::get_id()](std::size_t) {
      elsewhere += std::this_thread::get_id() != main;
    });
    EXPECT_EQ(elsewhere, 0);
  }
  EXPECT_EQ(resolve_thread_count(0), 5);
}

}  // namespace
}  // namespace brume
