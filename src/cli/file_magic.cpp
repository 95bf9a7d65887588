#include "cli/file_magic.h"

#include <array>
#include <cstring>
#include <fstream>

namespace brume {
namespace {

// OPENVDB_MAGIC as a little-endian 64-bit number.
constexpr std::array<char, 8> kGridMagic{' ', 'B', 'D', 'V', 0, 0, 0, 0};
// docs/cache_format.md
constexpr std::array<char, 8> kCacheMagic{'\x89', 'I', 'R', 'C', '\r', '\n', '\x1a', '\n'};

bool begins_with(const std::filesystem::path& file, const std::array<char, 8>& magic) {
  // Opening a FIFO would wait for a writer.
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) return false;
  std::array<char, 8> bytes{};
  std::ifstream stream(file, std::ios::binary);
  stream.read(bytes.data(), bytes.size());
  return stream.gcount() == std::ssize(bytes) && bytes == magic;
}

}  // namespace

bool has_grid_magic(const std::filesystem::path& file) { return begins_with(file, kGridMagic); }

bool has_cache_magic(const std::filesystem::path& file) { return begins_with(file, kCacheMagic); }

bool names_a_grid_file(const std::filesystem::path& file) {
  return has_grid_magic(file) || file.extension() == ".vdb";
}

}  // namespace brume
