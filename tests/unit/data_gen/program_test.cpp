// The data_gen program as scripts see it: exit codes, what it prints where, what it leaves behind.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <filesystem>
#include <string>

#include "support/scratch_folder.h"
#include "vdb_media/grid_file.h"

namespace brume {
namespace {

namespace fs = std::filesystem;

class DataGenProgram : public testing::Test {
 protected:
  struct Result {
    int status = -1;
    std::string out, err;
  };
  Result run(const std::string& arguments) {
    const fs::path out = folder_.path() / "out", err = folder_.path() / "err";
    const std::string command = "cd '" + files().string() + "' && '" BRUME_DATA_GEN "' " +
                                arguments + " >'" + out.string() + "' 2>'" + err.string() + "'";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_bytes(out), read_bytes(err)};
  }
  // Where it runs, and where nothing but what it writes is.
  fs::path files() {
    fs::create_directories(folder_.path() / "files");
    return folder_.path() / "files";
  }

 private:
  ScratchFolder folder_;
};

TEST_F(DataGenProgram, ShowsExamplesAndItsVersion) {
  const Result help = run("--help");
  EXPECT_EQ(help.status, 0);
  EXPECT_NE(help.out.find("data_gen smoky-cornell -o"), std::string::npos);
  EXPECT_EQ(help.err, "");
  EXPECT_EQ(run("--version").out, "data_gen " BRUME_VERSION "\n");
}

TEST_F(DataGenProgram, TellsUsageErrorsFromBadInputAndFromPlacesItCannotWrite) {
  struct Case {
    const char* arguments;
    int status;
  };
  for (const Case& c :
       {Case{"", 2}, Case{"fields", 2}, Case{"field ball", 2},
        Case{"field ball -o a.vdb --radius x", 2}, Case{"field ball -o a.vdb --bounds 0,0", 2},
        Case{"field atmosphere -o a.vdb --up 0,0,0", 2}, Case{"field ball -o a.vdb --voxel 0", 3},
        Case{"oracle nothing -o .", 3}, Case{"smoky-cornell -o . --resolution 1", 3},
        Case{"talk", 2}, Case{"talk windows -o new", 2}, Case{"talk window -o . --albedo 2", 3},
        Case{"slab", 2}, Case{"slab -o . --albedo 2", 3}, Case{"furnace -o . --resolution 1", 3},
        Case{"field ball -o missing/a.vdb", 6}}) {
    const Result result = run(c.arguments);
    EXPECT_EQ(result.status, c.status) << c.arguments;
    EXPECT_EQ(result.err.rfind("error: ", 0), 0u) << result.err;
    EXPECT_EQ(result.err.find('\n'), result.err.size() - 1) << "more than one line: " << result.err;
    EXPECT_EQ(result.out, "") << c.arguments;
  }
  EXPECT_TRUE(fs::is_empty(files()));
}

TEST_F(DataGenProgram, WritesEveryFieldWithItsValues) {
  for (const char* field : {"box", "ball", "ramp", "atmosphere", "gaussians", "plume", "dust"}) {
    const std::string file = std::string(field) + ".vdb";
    const Result result =
        run("field " + std::string(field) + " -o " + file + " --voxel 0.25 --grid-name smoke");
    ASSERT_EQ(result.status, 0) << field << ": " << result.err;
    EXPECT_EQ(result.out, file + "\n");
    const GridFileInfo info = inspect_grid_file(files() / file, {});
    ASSERT_EQ(info.grids.size(), 1u);
    EXPECT_EQ(info.grids[0].name, "smoke");
    EXPECT_GT(info.grids[0].max, 0) << field;
    EXPECT_GE(info.grids[0].min, 0) << field;
    EXPECT_EQ(info.grids[0].voxel_size, Vec3d(0.25));
  }
}

TEST_F(DataGenProgram, TakesParametersThatBeginWithAMinus) {
  ASSERT_EQ(run("field ball -o a.vdb --centre -0.5,0,-0.25 --radius 0.3 --voxel 0.125").status, 0);
  const GridFileInfo info = inspect_grid_file(files() / "a.vdb", {});
  const Box3d& bounds = info.grids.at(0).world_bounds;
  EXPECT_EQ(bounds.center(), Vec3d(-0.5, 0, -0.25));
}

TEST_F(DataGenProgram, RepeatsItsBytes) {
  ASSERT_EQ(run("field dust -o a.vdb --voxel 0.1 -t 1").status, 0);
  ASSERT_EQ(run("field dust -o b.vdb --voxel 0.1 -t 2").status, 0);
  EXPECT_EQ(read_bytes(files() / "a.vdb"), read_bytes(files() / "b.vdb"));
}

TEST_F(DataGenProgram, WritesReferenceScenesByName) {
  const Result result = run("oracle scatg -o scenes --step 0.25");
  ASSERT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(
      result.out,
      "scenes/scatg.json\nscenes/scatg_room.obj\nscenes/scatg_blocks.obj\nscenes/scatg.vdb\n");
  for (const char* name : {"scatg.json", "scatg_room.obj", "scatg_blocks.obj", "scatg.vdb"})
    EXPECT_TRUE(fs::is_regular_file(files() / "scenes" / name)) << name;
}

TEST_F(DataGenProgram, WritesAllScenesOfTheTalkIntoFoldersOfTheirOwn) {
  const Result result = run("talk all -o talk --resolution 8 --size 16");
  ASSERT_EQ(result.status, 0) << result.err;
  for (const char* scene :
       {"absorbing/absorbing.json", "scattering/scattering.json", "no-walls/no-walls.json",
        "smoky-cornell/smoky_cornell.json", "window/window.json", "disco/disco.json"}) {
    EXPECT_TRUE(fs::is_regular_file(files() / "talk" / scene)) << scene;
    EXPECT_NE(result.out.find("talk/" + std::string(scene) + "\n"), std::string::npos) << scene;
  }
}

TEST_F(DataGenProgram, WritesTheSlabAndTheFurnace) {
  EXPECT_EQ(run("slab -o slab --optical-depth 8 --albedo 0.9 --anisotropy -0.5 --width 30").out,
            "slab/slab.json\nslab/slab.obj\n");
  EXPECT_EQ(run("slab -o slab --diffuse --resolution 4").out,
            "slab/slab.json\nslab/slab.obj\nslab/sky.exr\nslab/slab.vdb\n");
  EXPECT_EQ(run("furnace -o furnace --optical-depth 10 --block-albedo 1 --resolution 8").out,
            "furnace/furnace.json\nfurnace/furnace.obj\nfurnace/furnace.vdb\n");
}

}  // namespace
}  // namespace brume
