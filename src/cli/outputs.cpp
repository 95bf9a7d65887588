#include "cli/outputs.h"

#include <cstdlib>

#include "core/error.h"
#include "core/staged_file.h"

namespace brume {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void cannot_write(const fs::path& file, const std::string& why) {
  throw Error(ErrorKind::Resource, printable(file.string()) + ": cannot write: " + why);
}

}  // namespace

void check_writable(const fs::path& file) {
  std::error_code status_error;
  const fs::file_status status = fs::status(file, status_error);
  if (status.type() == fs::file_type::none) cannot_write(file, status_error.message());
  if (fs::is_directory(status)) cannot_write(file, "it is a folder: name a file in it");
  if (fs::exists(status) && !fs::is_regular_file(status))
    cannot_write(file, "it is no regular file: name another");
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  const fs::file_status folder_status = fs::status(folder, status_error);
  if (!fs::exists(folder_status)) cannot_write(file, "its folder does not exist: create it first");
  if (!fs::is_directory(folder_status)) cannot_write(file, "its folder is a file: name another");
  // Permissions, quotas and read-only mounts: only trying tells.
  const StagedFile probe(file);
}

bool outputs_are_wanted(const std::vector<fs::path>& files, ExistingPolicy policy,
                        const CommandContext& context) {
  std::size_t existing = 0;
  for (const fs::path& file : files) {
    std::error_code ignored;
    if (!fs::exists(file, ignored)) continue;
    ++existing;
    if (policy == ExistingPolicy::Error)
      cannot_write(file, "it exists: remove it, or use --existing overwrite or skip");
  }
  if (policy == ExistingPolicy::Skip && !files.empty() && existing == files.size()) {
    context.note(printable(files.front().string()) + ": exists, skipped");
    return false;
  }
  for (const fs::path& file : files) check_writable(file);
  return true;
}

fs::path with_frame(const fs::path& file, const std::optional<int>& frame) {
  std::string name = file.string();
  const std::size_t begin = name.rfind("####");
  if (begin == std::string::npos) return file;
  if (!frame)
    throw Error(ErrorKind::Usage,
                printable(name) + ": has #### but no frame was given: add --frame N");
  std::size_t first = begin;
  while (first > 0 && name[first - 1] == '#') --first;
  const std::size_t width = begin + 4 - first;
  std::string number = std::to_string(std::abs(*frame));
  if (number.size() < width) number.insert(0, width - number.size(), '0');
  return name.replace(first, width, (*frame < 0 ? "-" : "") + number);
}

void print_json(const CommandContext& context, const Json& object) {
  // Text of foreign files may hold broken UTF-8, which JSON cannot.
  context.out << object.dump(2, ' ', false, Json::error_handler_t::replace) << '\n';
}

void report_statistics(const CommandContext& context, const Statistics& statistics) {
  if (!context.json && context.stats_file.empty()) return;
  const Json all = statistics.to_json();
  if (context.json) print_json(context, all);
  if (!context.stats_file.empty())
    write_file_whole(context.stats_file,
                     all.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace brume
