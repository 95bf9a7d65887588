// tools/read_irc.py knows only docs/cache_format.md: it must agree with our own reader.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>

#include "cache/irradiance_cache.h"
#include "sample_records.h"

namespace brume {
namespace {

struct ProgramRun {
  int status = -1;
  std::string output;
};
ProgramRun run_program(const std::string& command) {
  ProgramRun result;
  std::FILE* pipe = ::popen(command.c_str(), "r");
  if (!pipe) return result;
  char buffer[4096];
  while (const std::size_t got = std::fread(buffer, 1, sizeof buffer, pipe))
    result.output.append(buffer, got);
  const int status = ::pclose(pipe);
  if (WIFEXITED(status)) result.status = WEXITSTATUS(status);
  return result;
}

class IndependentReader : public testing::Test {
 protected:
  void SetUp() override {
    if (run_program("python3 --version 2>&1").status != 0) GTEST_SKIP() << "no python3";
  }
  ProgramRun read(const std::string& options) {
    return run_program("python3 '" BRUME_SOURCE_DIR "/tools/read_irc.py' '" + file_.string() + "' " + options +
               " 2>&1");
  }
  std::vector<SurfaceRecord> write(const std::vector<std::size_t>& batches) {
    std::vector<SurfaceRecord> all;
    CacheWriter writer(file_, sample_header());
    for (std::size_t i = 0; i < batches.size(); ++i) {
      const std::vector<SurfaceRecord> batch = sample_records(batches[i], 1, static_cast<int>(i));
      writer.seal(batch);
      all.insert(all.end(), batch.begin(), batch.end());
    }
    writer.finish();
    return all;
  }

  ScratchFolder folder_;
  std::filesystem::path file_ = folder_ / "a.irc";
};

TEST_F(IndependentReader, ReadsTheSameRecords) {
  // Blocks and counts of blocks on every branch of XXH3: payloads of 128 bytes and more, sums over 0, 8,
  // 16, 24, 160 and 320 bytes.
  for (const std::vector<std::size_t>& batches :
       {std::vector<std::size_t>{}, {1}, {1, 2}, {3, 8, 9}, std::vector<std::size_t>(20, 2),
        std::vector<std::size_t>(40, 1), {9000}}) {
    const std::vector<SurfaceRecord> records = write(batches);
    const ProgramRun listing = read("--records");
    ASSERT_EQ(listing.status, 0) << listing.output;
    std::istringstream lines(listing.output);
    std::string line;
    std::size_t i = 0;
    for (; std::getline(lines, line); ++i) {
      ASSERT_LT(i, records.size());
      const auto record = nlohmann::json::parse(line);
      ASSERT_EQ(record["key"].get<std::uint64_t>(), records[i].key);
      ASSERT_EQ(record["wave"].get<int>(), records[i].wave());
      ASSERT_EQ(record["irradiance"][2].get<float>(), records[i].irradiance[2]);
      ASSERT_EQ(record["gradient"][8].get<float>(), records[i].gradient[8]);
      ASSERT_EQ(record["position"][1].get<double>(), -20 + double(records[i].position[1]));
      ASSERT_EQ(record["media_share"].get<float>(), records[i].media_share);
    }
    ASSERT_EQ(i, records.size());
  }
}

TEST_F(IndependentReader, ReadsTheHeader) {
  write({10});
  const ProgramRun shown = read("");
  ASSERT_EQ(shown.status, 0) << shown.output;
  const auto header = nlohmann::json::parse(shown.output);
  EXPECT_EQ(header["fingerprint"], sample_header().fingerprint.hex());
  EXPECT_EQ(header["settings"], sample_header().settings);
  EXPECT_EQ(header["record_count"], 10);
}

TEST_F(IndependentReader, ReadsCachesAsBakesWriteThem) {
  std::vector<SurfaceRecord> records = sample_records(300, 1, 0);
  for (const SurfaceRecord& r : sample_records(41, 2, 128)) records.push_back(r);
  CacheHeader header = sample_header();
  header.shards = sample_shards();
  write_cache(file_, header, IrradianceCache(records, header.origin));
  const ProgramRun shown = read("");
  ASSERT_EQ(shown.status, 0) << shown.output;
  const auto json = nlohmann::json::parse(shown.output);
  EXPECT_EQ(json["record_count"], 341);
  EXPECT_EQ(json["blocks"].size(), 4u);
  EXPECT_EQ(json["blocks"][3]["kind"], 3);
  EXPECT_EQ(json["shards"]["count"], 10);
  EXPECT_EQ(json["shards"]["done"], (std::vector<int>{0, 4, 9}));
  EXPECT_EQ(json["shards"]["request"].get<std::uint64_t>(), sample_shards().request);
  const ProgramRun listing = read("--records");
  EXPECT_EQ(std::count(listing.output.begin(), listing.output.end(), '\n'), 341);
}

TEST_F(IndependentReader, ReadsRecordsOfTheMediumAndNotes) {
  const VolumeRecords volume = sample_volume_records(40, 2);
  const Vec3d origin = sample_header().origin;
  write_cache(file_, sample_header(),
              IrradianceCache(sample_records(30), origin, {},
                              std::make_shared<VolumeCache>(volume, origin)),
              kSampleNotes);
  const ProgramRun shown = read("");
  ASSERT_EQ(shown.status, 0) << shown.output;
  const auto header = nlohmann::json::parse(shown.output);
  EXPECT_EQ(header["record_count"], 70);
  EXPECT_EQ(header["solve"], nlohmann::json::parse(kSampleSolve));
  EXPECT_EQ(header["checks"], nlohmann::json::parse(kSampleNotes.checks));
  const ProgramRun listing = read("--records");
  std::istringstream lines(listing.output);
  std::string line;
  std::size_t i = 0;
  while (std::getline(lines, line)) {
    const auto record = nlohmann::json::parse(line);
    if (record["kind"] != "volume") continue;
    ASSERT_EQ(record["key"].get<std::uint64_t>(), volume.records[i].key);
    ASSERT_EQ(record["radius"][2].get<float>(), volume.records[i].radius[2]);
    ASSERT_EQ(record["clearance"].get<float>(), volume.records[i].clearance);
    ASSERT_EQ(record["moments"].size(), 27u);
    ASSERT_EQ(record["moments"][26].get<float>(), volume.moments_of(i)[8].value[2]);
    ASSERT_EQ(record["position"][0].get<double>(), 10 + double(volume.records[i].position[0]));
    ++i;
  }
  EXPECT_EQ(i, volume.size());
}

TEST_F(IndependentReader, RefusesDamage) {
  write({10, 20});
  const std::string good = read_bytes(file_);
  RandomStream random(3);
  for (int i = 0; i < 10; ++i) {
    std::string bad = good;
    bad[random.bits() % bad.size()] ^= 0x10;
    write_bytes(file_, bad);
    EXPECT_EQ(read("").status, 3);
  }
}

}  // namespace
}  // namespace brume
