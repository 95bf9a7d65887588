// Runs verbs in process on a small scene: a closed room, one lamp, thin haze.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "cli/run.h"

namespace brume {

struct RunResult {
  int code = -1;
  std::string out, err;

  nlohmann::json json() const { return nlohmann::json::parse(out, nullptr, false); }
};

// A folder of its own for each test, removed at its end.
class CliTest : public testing::Test {
 protected:
  void SetUp() override {
    const auto* test = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              ("brume_cli_" + std::to_string(getpid()) + "_" + test->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name), std::ios::binary) << text;
  }
  std::string read(const std::string& name) const {
    std::ifstream file(path(name), std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }
  bool exists(const std::string& name) const { return std::filesystem::exists(path(name)); }

  // `extra` is more top-level members, each followed by a comma.
  std::string write_scene(const std::string& name = "room.json", const std::string& extra = "",
                          const std::string& volumes = kHaze) const {
    write("room.obj", kRoom);
    write(name, "{\"version\": 1, " + extra +
                    R"("camera": {"position": [0, 1, 0.9], "look_at": [0, 0.9, 0], "fov_deg": 60},
                    "film": {"resolution": [16, 12]},
                    "materials": {"white": {"type": "diffuse", "albedo": [0.7, 0.6, 0.5]}},
                    "meshes": [{"file": "room.obj", "material": "white"}],
                    "lights": [{"type": "point", "position": [0, 1.7, 0], "intensity": [3, 3, 3]}],
                    "volumes": [)" +
                    volumes + R"(],
                    "render": {"bounces": 1, "volume_bounces": 1, "seed": 1, "cells": [4, 12]}})");
    return path(name);
  }

  static RunResult brume(const std::vector<std::string>& arguments) {
    std::ostringstream out, err;
    RunResult result;
    result.code = run(arguments, out, err);
    result.out = out.str();
    result.err = err.str();
    return result;
  }

  static constexpr const char* kHaze =
      R"({"type": "homogeneous", "bounds": [[-1, 0, -1], [1, 2, 1]], "sigma_s": [0.2, 0.2, 0.2],
          "sigma_a": [0.05, 0.05, 0.05]})";
  static constexpr const char* kRoom =
      "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv -1 2 -1\nv 1 2 -1\nv 1 2 1\nv -1 2 1\n"
      "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 4 8 7 3\nf 1 5 8 4\nf 2 3 7 6\n";

  std::filesystem::path folder_;
};

// A variable of the environment for one scope.
class ScopedVariable {
 public:
  ScopedVariable(const char* name, const char* value) : name_(name) { setenv(name, value, 1); }
  ~ScopedVariable() { unsetenv(name_); }
  ScopedVariable(const ScopedVariable&) = delete;
  ScopedVariable& operator=(const ScopedVariable&) = delete;

 private:
  const char* name_;
};

}  // namespace brume
