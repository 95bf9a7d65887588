// The child that parses a file which nobody vouches for: reads one request, writes one result.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <new>
#include <set>
#include <string>
#include <system_error>

#include "child_process.h"
#include "core/error.h"
#include "grid_blob.h"
#include "grid_loader.h"
#include "grid_names.h"
#include "unique_fd.h"
#include "vdb_reader.h"

namespace brume {
namespace {

[[noreturn]] void refuse(const std::string& file, const std::string& what) {
  throw Error(ErrorKind::InvalidInput, file + ": " + what);
}

std::string error_text(int error) { return std::generic_category().message(error); }

// A regular file, and never one that blocks while being opened (a FIFO).
UniqueFd open_regular(const std::string& path, const std::string& shown_as) {
  if (path.find('\0') != std::string::npos) refuse(shown_as, "a path cannot hold NUL: rename it");
  UniqueFd fd(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
  if (!fd.is_open()) refuse(shown_as, "cannot be opened: " + error_text(errno));
  struct stat s {};
  if (::fstat(fd.get(), &s) != 0) refuse(shown_as, "cannot be read: " + error_text(errno));
  if (S_ISDIR(s.st_mode)) refuse(shown_as, "is a directory: name an OpenVDB file");
  if (!S_ISREG(s.st_mode)) refuse(shown_as, "is not a regular file: name an OpenVDB file");
  return fd;
}

void check_magic(int fd, const std::string& shown_as) {
  std::array<char, 64> head{};
  const ssize_t got = ::pread(fd, head.data(), head.size(), 0);
  if (got < 0) refuse(shown_as, "cannot be read: " + error_text(errno));
  if (got == 0) refuse(shown_as, "is empty: export or copy it again");
  const std::string_view start(head.data(), static_cast<std::size_t>(got));
  if (start.starts_with(std::string_view(" BDV\0\0\0\0", 8))) return;
  if (start.starts_with("NanoVDB"))
    refuse(shown_as, "is a NanoVDB file, not OpenVDB: convert it with nanovdb_convert");
  if (start.starts_with("version https://git-lfs"))
    refuse(shown_as, "is a Git LFS pointer, not the file itself: fetch it with git lfs pull");
  if (start.starts_with("\x1f\x8b") || start.starts_with("PK\x03\x04"))
    refuse(shown_as, "is a compressed archive, not an OpenVDB file: unpack it first");
  if (std::string_view(" BDV\0\0\0\0", 8).starts_with(start))
    refuse(shown_as, "is cut off after " + std::to_string(got) + " bytes: copy it again");
  refuse(shown_as, "is not an OpenVDB file: name one");
}

LoadedList load(const VdbReader& reader, const std::string& file,
                const std::vector<GridRequest>& requests) {
  // All names are settled before any voxel is read.
  std::vector<std::optional<std::size_t>> chosen;
  for (const GridRequest& request : requests)
    chosen.push_back(choose_grid(file, reader.entries(), request));

  LoadedList list;
  for (std::size_t i = 0; i < requests.size(); ++i)
    list.push_back(chosen[i] ? std::optional(reader.load(*chosen[i], requests[i].role))
                             : std::nullopt);
  const auto first = std::find_if(list.begin(), list.end(), [](auto& g) { return g.has_value(); });
  for (std::size_t e = 0; e < reader.entries().size() && first != list.end(); ++e)
    if (is_velocity(reader.entries()[e]) &&
        std::find(chosen.begin(), chosen.end(), std::optional(e)) == chosen.end())
      (*first)->warnings.push_back(file + ": grid " + display_name(reader.entries(), e) +
                                   ": velocity is not used: ignored");
  return list;
}

GridFileInfo inspect(const VdbReader& reader, const std::string& file) {
  GridFileInfo info;
  for (std::size_t e = 0; e < reader.entries().size(); ++e) {
    info.grids.push_back(reader.inspect(e));
    const GridInfo& g = info.grids.back();
    const std::string at = file + ": grid " + g.name + ": ";
    if (is_velocity(reader.entries()[e])) info.warnings.push_back(at + "velocity is not used");
    if (g.background != 0 && !reader.entries()[e].is_level_set)
      info.warnings.push_back(at + "its background is not 0: needs --background zero or keep");
    if (g.nan_voxels + g.infinite_voxels > 0)
      info.warnings.push_back(at + std::to_string(g.nan_voxels + g.infinite_voxels) +
                              " voxels are not finite: sanitised when used");
    if (g.role && g.negative_voxels > 0)
      info.warnings.push_back(at + std::to_string(g.negative_voxels) +
                              " voxels are negative: sanitised when used");
  }
  if (info.grids.empty()) info.warnings.push_back(file + ": holds no grid");
  return info;
}

std::string mebibytes(std::uint64_t bytes) { return std::to_string(bytes >> 20) + " MiB"; }

LoaderResult answer(const LoaderRequest& request) {
  const std::string shown_as = printable(request.file, 1000);
  std::string place = shown_as;
  const auto trail = [&](const std::string& at) {
    place = at;
    write_trail(kResultFd, at);
  };
  try {
    trail(shown_as);
    const UniqueFd fd = open_regular(request.file, shown_as);
    check_magic(fd.get(), shown_as);
    // By descriptor, so that it is the very file just looked at.
    const VdbReader reader("/proc/self/fd/" + std::to_string(fd.get()), shown_as, request.options,
                           trail);
    if (request.inspect) return inspect(reader, shown_as);
    return load(reader, shown_as, request.grids);
  } catch (const Error& error) {
    return error;
  } catch (const std::bad_alloc&) {
    return Error(ErrorKind::InvalidInput,
                 place + ": damaged, or needs more than the memory limit of " +
                     mebibytes(request.options.memory_limit_bytes) + ": raise --memory-limit");
  }
}

}  // namespace

std::optional<int> run_grid_loader_child(int argc, char** argv) {
  note_loader_entry();
  if (argc != 3 || std::strcmp(argv[1], kLoaderArgument) != 0) return std::nullopt;
  pid_t parent = 0;
  const char* end = argv[2] + std::strlen(argv[2]);
  if (std::from_chars(argv[2], end, parent).ptr != end || !bind_to_parent(parent))
    return kLoaderNotSetUp;

  const LoaderRequest request = read_request(kRequestFd);
  ChildLimits limits;
  limits.memory_bytes = limits.file_bytes = request.options.memory_limit_bytes;
  limits.cpu_s = request.options.timeout_s;
  if (!apply_limits(limits)) return kLoaderNotSetUp;

  try {
    write_result(kResultFd, answer(request));
  } catch (const std::system_error& e) {
    // The result's size is limited too (EFBIG), and memory files run out with memory (ENOSPC).
    write_result(kResultFd, Error(ErrorKind::InvalidInput,
                                  printable(request.file, 1000) +
                                      ": its grids take more than the "
                                      "memory limit of " +
                                      mebibytes(request.options.memory_limit_bytes) + " (" +
                                      e.code().message() + "): raise --memory-limit"));
  }
  return 0;
}

}  // namespace brume
