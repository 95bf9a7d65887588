#include "grid_blob.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <system_error>

namespace brume {
namespace {

constexpr std::uint64_t kResultMagic = 0x42'44'56'65'6d'75'72'62;  // "brumeVDB"
constexpr std::size_t kBufferBytes = 1 << 16;
constexpr std::size_t kMaxString = 1 << 16;

enum class ResultKind : std::uint32_t { Failed = 1, Loaded = 2, Inspected = 3 };

void write_all(int fd, const char* data, std::size_t bytes) {
  while (bytes > 0) {
    const ssize_t done = ::write(fd, data, std::min<std::size_t>(bytes, 1 << 30));
    if (done < 0) {
      if (errno == EINTR) continue;
      throw std::system_error(errno, std::generic_category(), "writing grids to memory");
    }
    data += done;
    bytes -= static_cast<std::size_t>(done);
  }
}

// A whole file, mapped; the file is sealed, so it cannot shrink under the mapping.
class MappedFile {
 public:
  explicit MappedFile(int fd) {
    struct stat s {};
    if (::fstat(fd, &s) != 0) throw BlobError("the result cannot be read");
    size_ = static_cast<std::size_t>(s.st_size);
    if (size_ == 0) return;
    data_ = ::mmap(nullptr, size_, PROT_READ, MAP_SHARED, fd, 0);
    if (data_ == MAP_FAILED) throw std::bad_alloc();
  }
  ~MappedFile() {
    if (size_ > 0 && data_ != MAP_FAILED) ::munmap(data_, size_);
  }
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  std::span<const char> bytes() const { return {static_cast<const char*>(data_), size_}; }

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0;
};

void require(bool holds, const char* what) {
  if (!holds) throw BlobError(what);
}

void put_channel(BlobWriter& out, const BrickArrays& a) {
  out.put(a.brick_min);
  out.put(a.brick_count);
  for (const auto& row : a.index_to_world.m)
    for (const double v : row) out.put(v);
  out.put(a.top);
  out.put(a.bricks);
  out.put(a.tiles);
}

bool all_good(const std::vector<float>& values) {
  // NaN fails the comparison too.
  return std::all_of(values.begin(), values.end(),
                     [](float v) { return v >= 0 && v <= std::numeric_limits<float>::max(); });
}

BrickArrays get_channel(BlobReader& in) {
  constexpr std::int32_t kMaxBrick = (1 << 27) + 1;  // Brick positions of indices within +-2^30.
  BrickArrays a;
  a.brick_min = in.get_vec3i();
  a.brick_count = in.get_vec3i();
  for (auto& row : a.index_to_world.m)
    for (double& v : row) v = in.get<double>();
  std::int64_t entries = 1;
  for (int i = 0; i < 3; ++i) {
    require(std::abs(std::int64_t(a.brick_min[i])) <= kMaxBrick && a.brick_count[i] >= 0 &&
                a.brick_count[i] <= kMaxBrick,
            "a brick position is out of range");
    entries *= a.brick_count[i];
    require(entries <= kMaxTopEntries, "the brick index is too large");
  }
  require(a.index_to_world.inverse().has_value() && is_finite(a.index_to_world.translation()),
          "a transform is singular");
  a.top = in.get_array<std::int32_t>();
  a.bricks = in.get_array<float>();
  a.tiles = in.get_array<float>();
  require(std::int64_t(a.top.size()) == entries, "the brick index has the wrong size");
  require(a.bricks.size() % BrickGrid::kBrickFloats == 0, "a brick is incomplete");
  const auto bricks = static_cast<std::int64_t>(a.bricks.size() / BrickGrid::kBrickFloats);
  const auto tiles = static_cast<std::int64_t>(a.tiles.size());
  require(std::all_of(a.top.begin(), a.top.end(),
                      [&](std::int64_t t) { return t < bricks && t >= -1 - tiles; }),
          "a brick number is out of range");
  require(all_good(a.bricks) && all_good(a.tiles), "a voxel is negative or not finite");
  return a;
}

void put_loaded(BlobWriter& out, const LoadedList& list) {
  out.put(std::uint32_t(list.size()));
  for (const auto& grid : list) {
    out.put(std::uint8_t(grid.has_value()));
    if (!grid) continue;
    out.put(grid->name);
    out.put(grid->bad_voxels.nan);
    out.put(grid->bad_voxels.infinite);
    out.put(grid->bad_voxels.negative);
    out.put(grid->warnings);
    out.put(std::uint32_t(grid->channels.size()));
    for (const BrickArrays& channel : grid->channels) put_channel(out, channel);
  }
}

LoadedList get_loaded(BlobReader& in) {
  LoadedList list(in.get_count(1));
  for (auto& grid : list) {
    if (in.get<std::uint8_t>() == 0) continue;
    grid.emplace();
    grid->name = in.get_string();
    grid->bad_voxels.nan = in.get<std::uint64_t>();
    grid->bad_voxels.infinite = in.get<std::uint64_t>();
    grid->bad_voxels.negative = in.get<std::uint64_t>();
    grid->warnings = in.get_strings();
    const auto channels = in.get<std::uint32_t>();
    require(channels == 1 || channels == 3, "a grid has neither one channel nor three");
    for (std::uint32_t i = 0; i < channels; ++i) grid->channels.push_back(get_channel(in));
  }
  return list;
}

void put_info(BlobWriter& out, const GridInfo& g) {
  for (const std::string* text : {&g.name, &g.type, &g.grid_class, &g.transform, &g.compression})
    out.put(*text);
  out.put(std::uint8_t(g.saved_as_half));
  for (const std::uint64_t n :
       {g.active_voxels, g.active_tiles, g.nan_voxels, g.infinite_voxels, g.negative_voxels})
    out.put(n);
  for (const double v : {g.min, g.max, g.mean, g.background, g.proposed_density_scale}) out.put(v);
  out.put(g.voxel_size);
  out.put(g.index_min);
  out.put(g.index_max);
  out.put(g.world_bounds.min);
  out.put(g.world_bounds.max);
  out.put(std::uint8_t(g.role ? int(*g.role) + 1 : 0));
}

GridInfo get_info(BlobReader& in) {
  GridInfo g;
  for (std::string* text : {&g.name, &g.type, &g.grid_class, &g.transform, &g.compression})
    *text = in.get_string();
  g.saved_as_half = in.get<std::uint8_t>() != 0;
  for (std::uint64_t* n :
       {&g.active_voxels, &g.active_tiles, &g.nan_voxels, &g.infinite_voxels, &g.negative_voxels})
    *n = in.get<std::uint64_t>();
  for (double* v : {&g.min, &g.max, &g.mean, &g.background, &g.proposed_density_scale})
    *v = in.get<double>();
  g.voxel_size = in.get_vec3d();
  g.index_min = in.get_vec3i();
  g.index_max = in.get_vec3i();
  g.world_bounds.min = in.get_vec3d();
  g.world_bounds.max = in.get_vec3d();
  const int role = in.get<std::uint8_t>();
  require(role <= int(GridRole::Color) + 1, "a role is out of range");
  if (role > 0) g.role = GridRole(role - 1);
  return g;
}

}  // namespace

void BlobWriter::put(const std::string& text) {
  const std::size_t size = std::min(text.size(), kMaxString);
  put(std::uint32_t(size));
  put_bytes(text.data(), size);
}

void BlobWriter::put(const std::vector<std::string>& texts) {
  put(std::uint32_t(texts.size()));
  for (const std::string& text : texts) put(text);
}

void BlobWriter::put(const Vec3i& v) {
  for (int i = 0; i < 3; ++i) put(std::int32_t(v[i]));
}

void BlobWriter::put(const Vec3d& v) {
  for (int i = 0; i < 3; ++i) put(v[i]);
}

void BlobWriter::put_bytes(const void* data, std::size_t bytes) {
  const char* from = static_cast<const char*>(data);
  if (buffer_.size() + bytes > kBufferBytes) flush();
  if (bytes > kBufferBytes) {
    write_all(fd_, from, bytes);
  } else {
    buffer_.insert(buffer_.end(), from, from + bytes);
  }
}

void BlobWriter::flush() {
  write_all(fd_, buffer_.data(), buffer_.size());
  buffer_.clear();
}

void BlobReader::get_bytes(void* to, std::size_t bytes) {
  if (bytes > bytes_.size()) throw BlobError("the result ends too early");
  if (bytes > 0) std::memcpy(to, bytes_.data(), bytes);
  bytes_ = bytes_.subspan(bytes);
}

std::string BlobReader::get_string() {
  const auto size = get<std::uint32_t>();
  if (size > kMaxString || size > bytes_.size()) throw BlobError("a text is too long");
  std::string text(size, '\0');
  get_bytes(text.data(), size);
  return text;
}

std::vector<std::string> BlobReader::get_strings() {
  std::vector<std::string> texts(get_count(sizeof(std::uint32_t)));
  for (std::string& text : texts) text = get_string();
  return texts;
}

Vec3i BlobReader::get_vec3i() {
  Vec3i v;
  for (int i = 0; i < 3; ++i) v[i] = get<std::int32_t>();
  return v;
}

Vec3d BlobReader::get_vec3d() {
  Vec3d v;
  for (int i = 0; i < 3; ++i) v[i] = get<double>();
  return v;
}

std::uint32_t BlobReader::get_count(std::size_t min_bytes) {
  const auto count = get<std::uint32_t>();
  if (count > bytes_.size() / min_bytes) throw BlobError("a list is longer than the result");
  return count;
}

void write_request(int fd, const LoaderRequest& request) {
  BlobWriter out(fd);
  out.put(std::uint8_t(request.inspect));
  out.put(request.file);
  out.put(std::uint8_t(request.options.on_bad_voxels));
  out.put(std::uint8_t(request.options.background));
  out.put(request.options.memory_limit_bytes);
  out.put(request.options.max_voxels);
  out.put(request.options.timeout_s);
  out.put(std::uint32_t(request.grids.size()));
  for (const GridRequest& grid : request.grids) {
    out.put(std::uint8_t(grid.role));
    out.put(std::uint8_t(grid.name.has_value()));
    out.put(grid.name.value_or(""));
    out.put(std::uint8_t(grid.required));
  }
  out.flush();
}

LoaderRequest read_request(int fd) {
  const MappedFile file(fd);
  BlobReader in(file.bytes());
  LoaderRequest request;
  request.inspect = in.get<std::uint8_t>() != 0;
  request.file = in.get_string();
  request.options.on_bad_voxels = BadVoxelPolicy(in.get<std::uint8_t>());
  request.options.background = BackgroundPolicy(in.get<std::uint8_t>());
  request.options.memory_limit_bytes = in.get<std::uint64_t>();
  request.options.max_voxels = in.get<std::uint64_t>();
  request.options.timeout_s = in.get<double>();
  request.grids.resize(in.get_count(7));
  for (GridRequest& grid : request.grids) {
    grid.role = GridRole(in.get<std::uint8_t>());
    const bool named = in.get<std::uint8_t>() != 0;
    const std::string name = in.get_string();
    if (named) grid.name = name;
    grid.required = in.get<std::uint8_t>() != 0;
  }
  return request;
}

void write_trail(int fd, const std::string& text) {
  char trail[kTrailBytes] = {};
  std::memcpy(trail, text.data(), std::min(text.size(), kTrailBytes - 1));
  // Losing the trail loses a name in an error message, nothing more.
  if (::pwrite(fd, trail, kTrailBytes, 0) < 0) return;
}

std::string read_trail(int fd) {
  char trail[kTrailBytes] = {};
  if (::pread(fd, trail, kTrailBytes - 1, 0) < 0) return {};
  return trail;
}

void write_result(int fd, const LoaderResult& result) {
  if (::ftruncate(fd, kTrailBytes) != 0 || ::lseek(fd, kTrailBytes, SEEK_SET) < 0)
    throw std::system_error(errno, std::generic_category(), "writing grids to memory");
  BlobWriter out(fd);
  out.put(kResultMagic);
  if (const auto* error = std::get_if<Error>(&result)) {
    out.put(std::uint32_t(ResultKind::Failed));
    out.put(std::uint32_t(error->kind()));
    out.put(std::string(error->what()));
  } else if (const auto* list = std::get_if<LoadedList>(&result)) {
    out.put(std::uint32_t(ResultKind::Loaded));
    put_loaded(out, *list);
  } else {
    const auto& info = std::get<GridFileInfo>(result);
    out.put(std::uint32_t(ResultKind::Inspected));
    out.put(std::uint32_t(info.grids.size()));
    for (const GridInfo& g : info.grids) put_info(out, g);
    out.put(info.warnings);
  }
  out.flush();
}

LoaderResult parse_result(std::span<const char> bytes) {
  require(bytes.size() > kTrailBytes, "the result is empty");
  BlobReader in(bytes.subspan(kTrailBytes));
  require(in.get<std::uint64_t>() == kResultMagic, "the result does not begin as it should");
  const auto kind = ResultKind(in.get<std::uint32_t>());
  LoaderResult result = LoadedList{};
  if (kind == ResultKind::Failed) {
    const auto error = ErrorKind(in.get<std::uint32_t>());
    require(error == ErrorKind::InvalidInput || error == ErrorKind::Resource,
            "an error has an unknown kind");
    result = Error(error, in.get_string());
  } else if (kind == ResultKind::Loaded) {
    result = get_loaded(in);
  } else {
    require(kind == ResultKind::Inspected, "the result has an unknown kind");
    GridFileInfo info;
    info.grids.resize(in.get_count(100));
    for (GridInfo& g : info.grids) g = get_info(in);
    info.warnings = in.get_strings();
    result = std::move(info);
  }
  require(in.is_at_end(), "the result goes on past its end");
  return result;
}

LoaderResult read_result(int fd) { return parse_result(MappedFile(fd).bytes()); }

}  // namespace brume
