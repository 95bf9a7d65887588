#include "vdb_media/grid_writer.h"

#include <openvdb/openvdb.h>
#include <openvdb/tools/Prune.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <system_error>

#include "child_process.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/staged_file.h"
#include "unique_fd.h"

namespace brume {
namespace {

namespace fs = std::filesystem;

constexpr float kLargestHalf = 65504.0f, kSmallestHalf = 0x1p-24f;

[[noreturn]] void fail(const fs::path& file, const std::string& what, int error) {
  throw Error(ErrorKind::Resource,
              file.string() + ": " + what + ": " + std::generic_category().message(error));
}

openvdb::math::Transform::Ptr to_transform(const Affine3d& a) {
  openvdb::math::Mat4d m = openvdb::math::Mat4d::identity();  // Acts on row vectors.
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) m(j, i) = a.m[std::size_t(i)][std::size_t(j)];
  return openvdb::math::Transform::createLinearTransform(m);
}

void check(const fs::path& file, const GridToWrite& g) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ErrorKind::InvalidInput,
                file.string() + ": grid " + printable(g.name) + ": " + what);
  };
  std::uint64_t nodes = 1;
  for (int a = 0; a < 3; ++a) {
    if (g.count[a] < 0 || g.count[a] > (1 << 20)) refuse("its size is out of range");
    nodes *= static_cast<std::uint64_t>(g.count[a]);
  }
  if (g.values.size() != nodes * (g.is_vec3 ? 3 : 1)) refuse("its size is not that of its values");
  if (!g.index_to_world.inverse()) refuse("its transform is singular");
  if (g.is_vec3 && g.is_level_set) refuse("a vector grid cannot be a level set");
  if (!g.save_as_half) return;
  for (const float v : g.values)
    if (std::isfinite(v) && std::abs(v) > kLargestHalf)
      refuse("a value of " + std::to_string(v) +
             " does not fit half floats (at most 65504): "
             "write it in full");
}

template <typename Grid, typename Read, typename IsActive>
typename Grid::Ptr make_grid(const GridToWrite& g, const typename Grid::ValueType& background,
                             Read read, IsActive is_active) {
  auto grid = Grid::create(background);
  auto accessor = grid->getAccessor();
  std::size_t n = 0;
  for (int z = 0; z < g.count.z; ++z)
    for (int y = 0; y < g.count.y; ++y)
      for (int x = 0; x < g.count.x; ++x, ++n) {
        const auto value = read(n);
        const openvdb::Coord at(g.first.x + x, g.first.y + y, g.first.z + z);
        if (is_active(value)) {
          accessor.setValueOn(at, value);
        } else if (value != background) {
          accessor.setValueOff(at, value);
        }
      }
  // Constant regions become tiles, so that files stay small.
  openvdb::tools::prune(grid->tree());
  return grid;
}

openvdb::GridBase::Ptr to_openvdb(const GridToWrite& g) {
  openvdb::GridBase::Ptr grid;
  if (g.is_vec3) {
    grid = make_grid<openvdb::Vec3SGrid>(
        g, openvdb::Vec3f(g.background),
        [&](std::size_t n) {
          return openvdb::Vec3f(g.values[3 * n], g.values[3 * n + 1], g.values[3 * n + 2]);
        },
        [&](const openvdb::Vec3f& v) {
          return v != openvdb::Vec3f(0.0f) && v != openvdb::Vec3f(g.background);
        });
  } else {
    grid = make_grid<openvdb::FloatGrid>(
        g, g.background, [&](std::size_t n) { return g.values[n]; },
        [&](float v) {
          return g.is_level_set ? std::abs(v) < g.background : v != 0 && v != g.background;
        });
    grid->setGridClass(g.is_level_set ? openvdb::GRID_LEVEL_SET : openvdb::GRID_FOG_VOLUME);
  }
  grid->setName(g.name);
  grid->setTransform(to_transform(g.index_to_world));
  grid->setSaveFloatAsHalf(g.save_as_half);
  return grid;
}

// OpenVDB stamps each file with a random UUID, in text, after magic, versions and a flag. Ours is a
// hash of the rest, so that equal grids make equal files.
void stamp(const fs::path& file, std::vector<char>& bytes) {
  constexpr std::size_t kOffset = 8 + 4 + 4 + 4 + 1, kSize = 36;
  const auto is_uuid = [&] {
    if (bytes.size() < kOffset + kSize) return false;
    for (std::size_t i = 0; i < kSize; ++i) {
      const bool dash = i == 8 || i == 13 || i == 18 || i == 23;
      const char c = bytes[kOffset + i];
      if (dash ? c != '-' : !std::isxdigit(static_cast<unsigned char>(c))) return false;
    }
    return true;
  };
  if (!is_uuid())
    throw Error(ErrorKind::Internal,
                file.string() + ": this OpenVDB keeps its UUID at another place");
  std::fill_n(bytes.begin() + kOffset, kSize, '0');
  const std::string hex = FingerprintBuilder().add_bytes(bytes.data(), bytes.size()).finish().hex();
  std::string uuid;
  for (std::size_t i = 0; i < hex.size(); ++i) {
    if (i == 8 || i == 12 || i == 16 || i == 20) uuid += '-';
    uuid += hex[i];
  }
  std::copy(uuid.begin(), uuid.end(), bytes.begin() + kOffset);
}

std::vector<char> read_whole(const fs::path& file, int fd) {
  struct stat s {};
  if (::fstat(fd, &s) != 0) fail(file, "cannot be read back", errno);
  std::vector<char> bytes(static_cast<std::size_t>(s.st_size));
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t got = ::pread(fd, bytes.data() + done, bytes.size() - done, off_t(done));
    if (got <= 0) fail(file, "cannot be read back", got < 0 ? errno : EIO);
    done += static_cast<std::size_t>(got);
  }
  return bytes;
}

}  // namespace

std::vector<std::string> write_grids(const fs::path& file, const std::vector<GridToWrite>& grids) {
  std::vector<std::string> warnings;
  for (const GridToWrite& g : grids) {
    check(file, g);
    const auto lost = std::count_if(g.values.begin(), g.values.end(), [](float v) {
      return v != 0 && std::abs(v) < kSmallestHalf / 2;
    });
    if (g.save_as_half && lost > 0)
      warnings.push_back(file.string() + ": grid " + printable(g.name) + ": " +
                         std::to_string(lost) + " values are too small for half floats: became 0");
  }
  openvdb::initialize();
  openvdb::GridPtrVec converted;
  for (const GridToWrite& g : grids) converted.push_back(to_openvdb(g));

  // OpenVDB seeks while it writes and knows only paths, so it writes to a file in memory.
  const UniqueFd memory = make_memory_file("brume-grid-file");
  try {
    openvdb::io::File archive("/proc/self/fd/" + std::to_string(memory.get()));
    archive.setCompression(openvdb::io::COMPRESS_BLOSC | openvdb::io::COMPRESS_ACTIVE_MASK);
    archive.write(converted);
    archive.close();
  } catch (const openvdb::Exception& e) {
    throw Error(ErrorKind::Resource, file.string() + ": cannot be written: " + printable(e.what()));
  }
  std::vector<char> bytes = read_whole(file, memory.get());
  stamp(file, bytes);
  write_file_whole(file, {bytes.data(), bytes.size()});
  return warnings;
}

}  // namespace brume
