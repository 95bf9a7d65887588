// The program itself: signals, and a standard output that cannot be written.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <spawn.h>
#include <sys/wait.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "cli_fixture.h"

extern char** environ;

namespace brume {
namespace {

class Process : public CliTest {
 protected:
  // Its streams go to `out` and the file "err".
  pid_t start(std::vector<std::string> arguments, const std::string& out) {
    arguments.insert(arguments.begin(), BRUME_PROGRAM);
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 1, out.c_str(), O_WRONLY | O_CREAT, 0600);
    posix_spawn_file_actions_addopen(&actions, 2, path("err").c_str(), O_WRONLY | O_CREAT, 0600);
    pid_t pid = 0;
    EXPECT_EQ(posix_spawn(&pid, BRUME_PROGRAM, &actions, nullptr, argv.data(), environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    return pid;
  }
  static int exit_code_of(pid_t pid) {
    int status = 0;
    EXPECT_EQ(waitpid(pid, &status, 0), pid);
    EXPECT_TRUE(WIFEXITED(status));
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  // Long enough that a signal finds it at work.
  std::vector<std::string> long_path_trace() {
    return {"render", write_scene(), "-o",    path("a.exr"), "--integrator", "path",
            "--res",  "1024x1024",   "--spp", "1000",        "--progress",   "plain"};
  }
  void wait_until_err_has(const std::string& text) {
    for (int i = 0; i < 600 && read("err").find(text) == std::string::npos; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    EXPECT_THAT(read("err"), testing::HasSubstr(text));
  }
};

TEST_F(Process, AFullStandardOutputIsAnError) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "/dev/full is absent";
  EXPECT_EQ(exit_code_of(start({"--version"}, "/dev/full")), 6);
  EXPECT_THAT(read("err"), testing::HasSubstr("standard output"));
}

TEST_F(Process, ASignalWithoutACheckpointGives128PlusItsNumber) {
  const pid_t pid = start(long_path_trace(), path("out"));
  wait_until_err_has("render: ");
  kill(pid, SIGTERM);
  EXPECT_EQ(exit_code_of(pid), 128 + SIGTERM);
  EXPECT_FALSE(exists("a.exr"));
}

TEST_F(Process, ForeignGridsAreReadInAChildOfTheSameBinary) {
  const auto grid = std::filesystem::path(BRUME_SHARED_DATA) / "vdb" / "sphere_density.vdb";
  if (!std::filesystem::exists(grid)) GTEST_SKIP() << grid << " is absent";
  EXPECT_EQ(exit_code_of(start({"inspect", grid.string(), "--json"}, path("out"))), 0)
      << read("err");
  EXPECT_THAT(read("out"), testing::HasSubstr("\"role\": \"density\""));
}

}  // namespace
}  // namespace brume
