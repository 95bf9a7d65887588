// Damaged and hostile files: whatever they hold, this process lives and says one line (HARD_CASES
// T15, T16).
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <map>
#include <thread>

#include "core/random.h"
#include "grid_fixtures.h"

namespace brume {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// One small file of several kinds of node: leaves, tiles, two grids, metadata.
std::string seed_file(const TempDir& dir) {
  GridToWrite density = ball_grid(7);
  GridToWrite block = block_grid(Vec3i(-20), Vec3i(40), 0.5f, "temperature");
  write_grids(dir / "seed.vdb", {density, block});
  return read_file(dir / "seed.vdb");
}

std::string mutant(const std::string& seed, std::uint64_t number) {
  RandomStream random(random_key(2029, number));
  std::string bytes = seed;
  const auto place = [&] { return std::size_t(random.bits() % bytes.size()); };
  switch (number % 5) {
    case 0:  // Single bits; half of them near the start, where the structure is.
      for (int i = 0, n = 1 + int(random.bits() % 4); i < n; ++i)
        bytes[random.bits() % 2 ? place() : place() % 2048] ^= char(1 << random.bits() % 8);
      break;
    case 1:
      bytes.resize(place());
      break;
    case 2: {  // A piece of the file over another place.
      const std::size_t from = place(), to = place();
      const std::size_t size =
          std::min({bytes.size() - from, bytes.size() - to, std::size_t(1 + random.bits() % 256)});
      bytes.replace(to, size, bytes.substr(from, size));
      break;
    }
    case 3: {  // A word that claims much.
      const std::size_t at = place(), size = std::min<std::size_t>(8, bytes.size() - at);
      const char fill = "\xff\x7f\x80\x00"[random.bits() % 4];
      bytes.replace(at, size, std::string(size, fill));
      break;
    }
    default:  // Bytes taken out: everything behind is shifted.
      bytes.erase(place(), 1 + random.bits() % 16);
      break;
  }
  return bytes;
}

TEST(HostileFile, MutantsLoadOrAreRefusedInOneLine) {
  const TempDir dir;
  const std::string seed = seed_file(dir);
  GridFileOptions options;
  options.timeout_s = 3;
  options.memory_limit_bytes = 512ull << 20;
  std::map<std::string, int> endings;
  double slowest = 0;
  const auto all = std::chrono::steady_clock::now();
  for (std::uint64_t i = 0; i < 300; ++i) {
    write_file(dir / "mutant.vdb", mutant(seed, i));
    const auto start = std::chrono::steady_clock::now();
    try {
      const auto grids =
          load_grids(dir / "mutant.vdb",
                     {GridRequest{}, {GridRole::Temperature, std::nullopt, false}}, options);
      ASSERT_TRUE(grids.at(0).has_value());
      ++endings["loaded"];
    } catch (const Error& e) {
      const std::string text = e.what();
      EXPECT_EQ(e.kind(), ErrorKind::InvalidInput) << "mutant " << i << ": " << text;
      EXPECT_EQ(text.find('\n'), std::string::npos) << text;
      EXPECT_NE(text.find("mutant.vdb"), std::string::npos) << text;
      ++endings[text.find("crashed") != std::string::npos           ? "crashed"
                : text.find("not read within") != std::string::npos ? "timed out"
                : text.find("memory limit") != std::string::npos    ? "memory"
                                                                    : "refused"];
    }
    slowest = std::max(slowest, seconds_since(start));
    EXPECT_LT(seconds_since(start), 10) << "mutant " << i;
  }
  for (const auto& [ending, count] : endings) std::printf("  %s: %d\n", ending.c_str(), count);
  std::printf("  slowest %.2f s, all %.1f s\n", slowest, seconds_since(all));
  EXPECT_GT(endings["loaded"], 0);
  EXPECT_GT(endings["refused"], 0);
}

TEST(HostileFile, InspectingMutantsIsAsSafe) {
  const TempDir dir;
  const std::string seed = seed_file(dir);
  GridFileOptions options;
  options.timeout_s = 3;
  options.memory_limit_bytes = 512ull << 20;
  for (std::uint64_t i = 1000; i < 1040; ++i) {
    write_file(dir / "mutant.vdb", mutant(seed, i));
    try {
      inspect_grid_file(dir / "mutant.vdb", options);
    } catch (const Error& e) {
      EXPECT_EQ(e.kind(), ErrorKind::InvalidInput) << "mutant " << i << ": " << e.what();
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  }
}

// Sends `number` to this thread's first child as soon as there is one.
void signal_child_of(const std::string& thread_id, int number) {
  const std::string children = "/proc/self/task/" + thread_id + "/children";
  for (int i = 0; i < 200'000; ++i) {
    std::ifstream in(children);
    pid_t child = 0;
    if (in >> child) {
      ::kill(child, number);
      return;
    }
    std::this_thread::sleep_for(std::chrono::microseconds(20));
  }
}

TEST(HostileFile, AReaderThatCrashesIsReportedInOneLine) {
  if (!std::filesystem::exists("/proc/thread-self/children"))
    GTEST_SKIP() << "this kernel does not list children";
  const TempDir dir;
  write_grids(dir / "a.vdb", {ball_grid(40)});
  for (const auto& [number, name] :
       {std::pair(SIGABRT, "ABRT"), std::pair(SIGSEGV, "SEGV"), std::pair(SIGKILL, "KILL")}) {
    std::thread killer(signal_child_of, std::to_string(::gettid()), number);
    const Error e = load_error(dir / "a.vdb");
    killer.join();
    EXPECT_EQ(e.kind(), ErrorKind::InvalidInput);
    EXPECT_THAT(e.what(), testing::HasSubstr((dir / "a.vdb").string()));
    EXPECT_THAT(e.what(),
                testing::HasSubstr(std::string("the reader crashed (signal ") + name + ")"));
  }
}

}  // namespace
}  // namespace brume
