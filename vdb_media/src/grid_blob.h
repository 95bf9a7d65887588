// What parent and loader child say to each other, as bytes.
//
// Both ends are the same binary, so numbers stand in the machine's own order and no version is
// kept. The child has parsed a hostile file, so the parent believes nothing: every count is checked
// against the bytes present before anything is allocated, and every number for its range
// (HARD_CASES, security posture).
//
//   result   = trail[kTrailBytes] u64:kResultMagic u32:kind body, to the end of the file exactly
//   trail    = text that says what the child was at, NUL-padded: names the grid if the child dies
//   error    = u32:ErrorKind string
//   loaded   = u32:n { u8:present [string:name u64 u64 u64 strings u32:channels channel* ] }*n
//   channel  = i32*3:brick_min i32*3:brick_count f64*12 array<i32>:top array<f32>:bricks
//              array<f32>:tiles
//   inspected= u32:n info*n strings:warnings
//   string   = u32:size bytes     strings = u32:n string*n     array = u64:n elements
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "core/error.h"
#include "vdb_media/grid_file.h"

namespace brume {

inline constexpr std::size_t kTrailBytes = 512;
// Entries of a brick grid's top index: 512^3 bricks, 4096 voxels a side where that is a cube.
inline constexpr std::int64_t kMaxTopEntries = std::int64_t(1) << 27;

// The arguments of BrickGrid's constructor.
struct BrickArrays {
  Vec3i brick_min{0}, brick_count{0};
  std::vector<std::int32_t> top;
  std::vector<float> bricks, tiles;
  Affine3d index_to_world;
};

// A LoadedGrid before the parent has made grids of it.
struct LoadedArrays {
  std::string name;
  std::vector<BrickArrays> channels;
  BadVoxels bad_voxels;
  std::vector<std::string> warnings;
};

struct LoaderRequest {
  bool inspect = false;
  std::string file;
  std::vector<GridRequest> grids;
  GridFileOptions options;  // memory_limit_bytes is resolved.
};

using LoadedList = std::vector<std::optional<LoadedArrays>>;
using LoaderResult = std::variant<Error, LoadedList, GridFileInfo>;

// The bytes do not say what they should.
class BlobError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Appends to a file descriptor. Throws std::system_error where the system refuses.
class BlobWriter {
 public:
  explicit BlobWriter(int fd) : fd_(fd) {}

  template <typename T>
  requires std::is_arithmetic_v<T>
  void put(T value) { put_bytes(&value, sizeof value); }
  void put(const std::string& text);
  void put(const std::vector<std::string>& texts);
  void put(const Vec3i& v);
  void put(const Vec3d& v);
  template <typename T>
  requires std::is_arithmetic_v<T>
  void put(const std::vector<T>& values) {
    put(std::uint64_t(values.size()));
    put_bytes(values.data(), values.size() * sizeof(T));
  }
  void put_bytes(const void* data, std::size_t bytes);
  void flush();

 private:
  int fd_;
  std::vector<char> buffer_;
};

// Reads what BlobWriter wrote. Every get throws BlobError rather than read past the end.
class BlobReader {
 public:
  explicit BlobReader(std::span<const char> bytes) : bytes_(bytes) {}

  template <typename T>
  requires std::is_arithmetic_v<T> T get() {
    T value;
    get_bytes(&value, sizeof value);
    return value;
  }
  std::string get_string();
  std::vector<std::string> get_strings();
  Vec3i get_vec3i();
  Vec3d get_vec3d();
  template <typename T>
  requires std::is_arithmetic_v<T> std::vector<T> get_array() {
    const auto count = get<std::uint64_t>();
    if (count > bytes_.size() / sizeof(T)) throw BlobError("an array is longer than the result");
    std::vector<T> values(count);
    get_bytes(values.data(), count * sizeof(T));
    return values;
  }
  // Of things that take at least `min_bytes` each.
  std::uint32_t get_count(std::size_t min_bytes);
  bool is_at_end() const { return bytes_.empty(); }

 private:
  void get_bytes(void* to, std::size_t bytes);
  std::span<const char> bytes_;
};

void write_request(int fd, const LoaderRequest& request);
LoaderRequest read_request(int fd);

// Says in the result what the child is about to do.
void write_trail(int fd, const std::string& text);
std::string read_trail(int fd);
// Replaces whatever was written after the trail.
void write_result(int fd, const LoaderResult& result);
// The whole result, checked. Throws BlobError.
LoaderResult read_result(int fd);
LoaderResult parse_result(std::span<const char> bytes);

}  // namespace brume
