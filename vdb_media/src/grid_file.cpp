#include "vdb_media/grid_file.h"

#include <signal.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <new>
#include <utility>
#include <variant>

#include "child_process.h"
#include "core/error.h"
#include "grid_blob.h"
#include "grid_loader.h"

namespace brume {
namespace {

std::atomic<bool> loader_entry_noted = false;

std::string signal_name(int number) {
  const char* name = ::sigabbrev_np(number);
  return name != nullptr ? name : std::to_string(number);
}

[[noreturn]] void refuse(const std::string& place, const std::string& what) {
  throw Error(ErrorKind::InvalidInput, place + ": " + what);
}

std::string seconds(double s) {
  std::string text = std::to_string(s);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.ends_with('.')) text.pop_back();
  return text + " s";
}

void check_options(const std::string& file, const GridFileOptions& options) {
  if (!(options.timeout_s > 0) || !std::isfinite(options.timeout_s) || options.timeout_s > 1e6)
    throw Error(ErrorKind::Usage, file +
                                      ": the time limit for loading must be above 0 and at "
                                      "most 1e6 s");
}

// Throws for a child that ended otherwise than with a result.
void check_outcome(const std::string& file, const std::string& trail, const ChildOutcome& outcome,
                   double timeout_s) {
  const std::string place = trail.empty() ? file : printable(trail, kTrailBytes);
  const std::string said = outcome.message.empty() ? "" : ": " + outcome.message;
  switch (outcome.ending) {
    case ChildOutcome::Ending::TimedOut:
      refuse(place, "damaged, or too large: not read within " + seconds(timeout_s) +
                        ": raise --load-timeout if the file is known to be good");
    case ChildOutcome::Ending::Signalled:
      refuse(place, "damaged: the reader crashed (signal " + signal_name(outcome.code) + ")" +
                        said + ": export the file again");
    case ChildOutcome::Ending::Exited:
      break;
  }
  if (outcome.code == kLoaderNotSetUp)
    throw Error(ErrorKind::Resource, file +
                                         ": the system refused to limit the reader's memory or "
                                         "time, so the file was not read");
  if (outcome.code != 0)
    refuse(place, "damaged: the reader gave up (status " + std::to_string(outcome.code) + ")" +
                      said + ": export the file again");
}

LoaderResult ask_child(LoaderRequest request) {
  const std::string shown_as = printable(request.file, 1000);
  check_options(shown_as, request.options);
  if (!loader_entry_noted)
    throw Error(ErrorKind::Resource,
                shown_as +
                    ": grids are read by a second copy of this program, and its main() "
                    "does not provide for that: call brume::run_grid_loader_child(argc, "
                    "argv) first in main() and return the value it gives");
  if (request.options.memory_limit_bytes == 0)
    request.options.memory_limit_bytes = default_memory_limit();

  const UniqueFd question = make_memory_file("brume-grid-request");
  const UniqueFd result = make_memory_file("brume-grid-result");
  write_request(question.get(), request);
  const ChildOutcome outcome =
      run_child_of_self(kLoaderArgument, question.get(), result.get(), request.options.timeout_s);
  check_outcome(shown_as, read_trail(result.get()), outcome, request.options.timeout_s);
  if (!seal_memory_file(result.get()))
    throw Error(ErrorKind::Resource, shown_as + ": the reader's result could not be sealed");
  try {
    LoaderResult answer = read_result(result.get());
    if (const auto* error = std::get_if<Error>(&answer))
      throw Error(error->kind(), printable(error->what(), 4000));
    return answer;
  } catch (const BlobError& e) {
    refuse(shown_as, std::string("damaged: the reader's result makes no sense: ") + e.what() +
                         ": export the file again");
  } catch (const std::bad_alloc&) {
    throw Error(ErrorKind::Resource, shown_as + ": not enough memory for its grids");
  }
}

std::vector<std::string> printable_lines(const std::vector<std::string>& lines) {
  std::vector<std::string> out;
  for (const std::string& line : lines) out.push_back(printable(line, 4000));
  return out;
}

LoadedGrid to_grid(LoadedArrays arrays) {
  LoadedGrid grid;
  grid.name = printable(arrays.name);
  grid.bad_voxels = arrays.bad_voxels;
  grid.warnings = printable_lines(arrays.warnings);
  for (BrickArrays& a : arrays.channels)
    grid.channels.push_back(std::make_shared<const BrickGrid>(
        a.brick_min, a.brick_count, std::move(a.top), std::move(a.bricks), std::move(a.tiles),
        a.index_to_world));
  return grid;
}

}  // namespace

void note_loader_entry() { loader_entry_noted = true; }

std::vector<std::optional<LoadedGrid>> load_grids(const std::filesystem::path& file,
                                                  const std::vector<GridRequest>& requests,
                                                  const GridFileOptions& options) {
  LoaderRequest request;
  request.file = file.string();
  request.grids = requests;
  request.options = options;
  LoaderResult result = ask_child(std::move(request));
  auto* list = std::get_if<LoadedList>(&result);
  if (list == nullptr || list->size() != requests.size())
    refuse(printable(file.string(), 1000), "damaged: the reader answered another question");
  std::vector<std::optional<LoadedGrid>> grids;
  for (auto& arrays : *list)
    grids.push_back(arrays ? std::optional(to_grid(std::move(*arrays))) : std::nullopt);
  return grids;
}

GridFileInfo inspect_grid_file(const std::filesystem::path& file, const GridFileOptions& options) {
  LoaderRequest request;
  request.inspect = true;
  request.file = file.string();
  request.options = options;
  LoaderResult result = ask_child(std::move(request));
  auto* info = std::get_if<GridFileInfo>(&result);
  if (info == nullptr)
    refuse(printable(file.string(), 1000), "damaged: the reader answered another question");
  for (GridInfo& g : info->grids)
    for (std::string* text : {&g.name, &g.type, &g.grid_class, &g.transform, &g.compression})
      *text = printable(*text);
  info->warnings = printable_lines(info->warnings);
  return std::move(*info);
}

}  // namespace brume
