// Runs the program itself, in whatever circumstances: signals, limits, closed streams, failing
// disks.
#pragma once

#include <fcntl.h>
#include <gmock/gmock.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <chrono>
#include <functional>
#include <thread>

#include "cache/cache_file.h"
#include "cache/cache_journal.h"
#include "cli_fixture.h"

extern char** environ;

namespace brume {

// A way to run the program.
struct Circumstances {
  std::vector<std::string> environment{};  // NAME=VALUE, on top of this process's.
  std::function<void()> before_exec{};     // In the child; may call what is safe after a fork.
};

class ProgramTest : public CliTest {
 protected:
  // Its streams go to the files "out" and "err".
  pid_t start(std::vector<std::string> arguments, const Circumstances& how = {}) {
    arguments.insert(arguments.begin(), BRUME_PROGRAM);
    std::vector<char*> argv, envp;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    std::vector<std::string> environment = how.environment;
    for (std::string& variable : environment) envp.push_back(variable.data());
    for (char** variable = environ; *variable; ++variable) envp.push_back(*variable);
    envp.push_back(nullptr);
    const std::string out = path("out"), err = path("err");
    std::filesystem::remove(err);  // What an earlier run said is not waited for.
    const pid_t pid = fork();
    if (pid == 0) {
      dup2(open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666), 1);
      dup2(open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666), 2);
      if (how.before_exec) how.before_exec();
      execve(BRUME_PROGRAM, argv.data(), envp.data());
      _exit(127);
    }
    EXPECT_GT(pid, 0);
    return pid;
  }
  // Minus the signal's number where one ended it.
  static int end_of(pid_t pid) {
    int status = 0;
    EXPECT_EQ(waitpid(pid, &status, 0), pid);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  int run_program(const std::vector<std::string>& arguments, const Circumstances& how = {}) {
    return end_of(start(arguments, how));
  }
  void wait_until_err_has(const std::string& text) {
    for (int i = 0; i < 6000 && read("err").find(text) == std::string::npos; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_THAT(read("err"), testing::HasSubstr(text));
  }

  // For messages.
  std::string end_of_err() const {
    const std::string err = read("err");
    return err.substr(err.size() - std::min<std::size_t>(err.size(), 400));
  }

  // A bake of about a quarter of a second, which seals all the time.
  std::vector<std::string> bake(const std::string& file,
                                const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"bake",  scene(),           "-o",      path(file),
                                       "--res", "48x36",           "--error", "0.2",
                                       "-vv",   "--seal-interval", "0"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  // One of a tenth of that, where there is a run for each of many faults.
  std::vector<std::string> small_bake(const std::string& file,
                                      const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{
        "bake",    scene(), "-o", path(file), "--res",           "16x12",
        "--error", "1",     "-t", "1",        "--seal-interval", "0.01"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  // The same as bake(), and it takes until it is stopped.
  std::vector<std::string> endless_bake(const std::string& file,
                                        const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = bake(file, more);
    arguments.insert(arguments.end(), {"--cells", "256x800", "--error", "0.02"});
    return arguments;
  }
  const std::string& scene() {
    if (scene_.empty()) scene_ = write_scene();
    return scene_;
  }
  // The bytes that bake() makes undisturbed.
  const std::string& whole() {
    if (whole_.empty()) {
      EXPECT_EQ(run_program(bake("whole.irc")), 0) << read("err");
      whole_ = read("whole.irc");
    }
    return whole_;
  }
  // Nothing is left but the cache.
  bool is_tidy(const std::string& file) const {
    return exists(file) && !exists(file + ".part") && !exists(file + ".next");
  }
  // "sealed N records": the last N in "err".
  std::size_t reported_sealed() const {
    const std::string err = read("err"), mark = "sealed ";
    // A line that the kill cut short reports nothing.
    const std::size_t end = err.rfind(" records\n");
    if (end == std::string::npos) return 0;
    const std::size_t at = err.rfind(mark, end);
    return at == std::string::npos ? 0 : std::stoul(err.substr(at + mark.size()));
  }
  std::size_t records_in(const std::string& file) const {
    return check_cache(path(file)).opening.contents.records.size();
  }
  std::size_t deep_records_in(const std::string& file) const {
    const CacheCheck check = check_cache(path(file));
    std::size_t deep = 0;
    for (const SurfaceRecord& r : check.opening.contents.records) deep += r.layer() == kDeepLayer;
    return deep;
  }

 private:
  std::string scene_, whole_;
};

}  // namespace brume
