// Records that are valid, all different, and the same every time.
#pragma once

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "cache/cache_file.h"
#include "core/error.h"
#include "core/random.h"
#include "support/scratch_folder.h"

namespace brume {

inline Vec3d random_direction(RandomStream& random) {
  const double z = 2 * random.uniform() - 1, phi = 2 * kPi * random.uniform();
  const double s = std::sqrt(1 - z * z);
  return {s * std::cos(phi), s * std::sin(phi), z};
}

// In RecordOrder, inside the unit cube, with radii of 0.1 to 0.2.
inline std::vector<SurfaceRecord> sample_records(std::size_t count, int layer = 1, int wave = 0,
                                                 std::uint64_t seed = 1) {
  RandomStream random(random_key(seed, layer, wave));
  std::vector<SurfaceRecord> records(count);
  std::uint64_t key = 0;
  for (SurfaceRecord& record : records) {
    record = {};
    const Vec3d n = random_direction(random);
    for (int a = 0; a < 3; ++a) {
      record.position[a] = static_cast<float>(random.uniform());
      record.normal[a] = static_cast<float>(n[a]);
      record.irradiance[a] = static_cast<float>(1 + random.uniform());
    }
    for (float& g : record.gradient) g = static_cast<float>(random.uniform() - 0.5);
    for (float& g : record.rotational) g = static_cast<float>(random.uniform() - 0.5);
    record.axis = static_cast<float>(kPi * random.uniform());
    for (float& r : record.radius) r = static_cast<float>(0.1 + 0.1 * random.uniform());
    record.error = static_cast<float>(0.05 * random.uniform());
    record.media_share = static_cast<float>(random.uniform());
    record.flags = record_flags(layer, wave);
    record.key = key += 1 + (random.bits() >> 32);
  }
  return records;
}

// In VolumeRecordOrder, inside the unit cube.
inline VolumeRecords sample_volume_records(std::size_t count, int order, int wave = 0) {
  RandomStream random(random_key(order, wave));
  VolumeRecords all;
  all.order = order;
  std::vector<VolumeMoment> moments(all.stride());
  std::uint64_t key = 0;
  for (std::size_t i = 0; i < count; ++i) {
    VolumeRecord record{};
    for (int a = 0; a < 3; ++a) {
      record.position[a] = static_cast<float>(random.uniform());
      record.radius[a] = static_cast<float>(0.1 + 0.1 * random.uniform());
    }
    record.axes[0] = 1;
    record.error = static_cast<float>(0.05 * random.uniform());
    record.media_share = static_cast<float>(random.uniform());
    record.clearance = static_cast<float>(random.uniform());
    record.flags = record_flags(kDeepVolumeLayer, wave);
    record.key = key += 1 + (random.bits() >> 32);
    for (VolumeMoment& m : moments)
      for (float& v : m.value) v = static_cast<float>(random.uniform() - 0.5);
    for (float& v : moments[0].value) v += 1;
    all.push_back(record, moments);
  }
  return all;
}

inline const char* const kSampleSolve = R"({"orders":3,"changes":[0.5,0.25],"ratio":0.5})";
inline const CacheNotes kSampleNotes{kSampleSolve, R"([{"request":7,"points":[]}])"};

inline CacheHeader sample_header() {
  CacheHeader header;
  header.fingerprint = {{0x0123456789abcdefULL, 0xfedcba9876543210ULL}};
  header.origin = Vec3d(10, -20, 0.5);
  header.settings = R"({"bounces":2,"cells":[16,50],"seed":7})";
  header.creator = "brume test";
  return header;
}

// Some of ten.
inline ShardSet sample_shards() { return {0x1122334455667788ULL, 10, {0, 4, 9}}; }

inline bool same_bits(const std::vector<SurfaceRecord>& a, const std::vector<SurfaceRecord>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof a[0]) == 0);
}

// Without a lookup order.
inline void write_batches(const std::filesystem::path& file,
                          const std::vector<std::vector<SurfaceRecord>>& batches,
                          const CacheHeader& header = sample_header()) {
  CacheWriter writer(file, header);
  for (const auto& batch : batches) writer.seal(batch);
  writer.finish();
}

template <typename Action>
ErrorKind kind_thrown(Action&& action, std::string* message = nullptr) {
  try {
    action();
  } catch (const Error& error) {
    if (message) *message = error.what();
    return error.kind();
  }
  ADD_FAILURE() << "nothing was thrown";
  return ErrorKind::Internal;
}

// While one lives no file may grow beyond `bytes`: a full disk, as far as a writer can tell.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    struct sigaction ignore {};
    ignore.sa_handler = SIG_IGN;
    ::sigaction(SIGXFSZ, &ignore, &action_);
    ::getrlimit(RLIMIT_FSIZE, &limit_);
    const struct rlimit low { bytes, limit_.rlim_max };
    ::setrlimit(RLIMIT_FSIZE, &low);
  }
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &limit_);
    ::sigaction(SIGXFSZ, &action_, nullptr);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  struct rlimit limit_ {};
  struct sigaction action_ {};
};

inline void write_bytes(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace brume
