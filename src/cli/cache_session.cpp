#include "cli/cache_session.h"

#include <sys/stat.h>

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>

#include "bake/record_maker.h"
#include "cache/cache_merge.h"
#include "cli/version.h"
#include "core/error.h"

namespace brume {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// "; baked with cells [8,8], here [16,50]": which settings differ, if that is what made it stale.
std::string settings_difference(const fs::path& file, const BakeSettings& settings) {
  const CacheOpening opening = open_cache(file, std::nullopt);
  const Json there = Json::parse(opening.contents.header.settings, nullptr, false);
  const Json here = Json::parse(settings.to_json(), nullptr, false);
  if (!there.is_object() || !here.is_object()) return "";
  std::string text;
  for (const auto& [key, value] : here.items())
    if (there.contains(key) && there[key] != value)
      text += (text.empty() ? "; baked with " : ", with ") + key + " " + there[key].dump() +
              ", here " + value.dump();
  return text.empty() ? "; the settings are equal, so geometry, materials, lights or media changed"
                      : text;
}

std::string refusal(const fs::path& file, const CacheOpening& opening, const std::string& remedy) {
  return printable(file.string()) + ": " + cache_state_name(opening.state) + ": " + opening.reason +
         ": " + remedy;
}

FileIdentity identity_of(const fs::path& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) return {};
  return {status.st_dev, status.st_ino, static_cast<std::uint64_t>(status.st_size),
          status.st_mtim.tv_sec * std::int64_t(1'000'000'000) + status.st_mtim.tv_nsec};
}

bool has_unfinished(const IrradianceCache& cache) {
  return std::any_of(cache.records().begin(), cache.records().end(),
                     [](const SurfaceRecord& r) { return (r.flags & kUnfinishedViewFlag) != 0; });
}

bool has_same_records(const IrradianceCache& a, const IrradianceCache& b) {
  return a.records().size() == b.records().size() &&
         (a.records().empty() ||
          std::memcmp(a.records().data(), b.records().data(), a.records().size_bytes()) == 0) &&
         a.volume()->all() == b.volume()->all();
}

bool holds_shard(const ShardSet& shards, const BakeRequest& request) {
  return shards.count == request.shard.count && shards.request == request_hash(request) &&
         std::binary_search(shards.done.begin(), shards.done.end(), request.shard.index);
}

// Those that `request` leaves behind, where `before` were there.
ShardSet shards_after(const ShardSet& before, const BakeRequest& request, bool is_stopped) {
  if (request.shard.count == 1) return is_stopped ? before : ShardSet();
  ShardSet after{request_hash(request), request.shard.count, {}};
  if (before.count == after.count && before.request == after.request) after.done = before.done;
  const auto place = std::lower_bound(after.done.begin(), after.done.end(), request.shard.index);
  if (!is_stopped && (place == after.done.end() || *place != request.shard.index))
    after.done.insert(place, request.shard.index);
  return after;
}

}  // namespace

std::string cache_state_name(CacheState state) {
  switch (state) {
    case CacheState::Loaded:
      return "loaded";
    case CacheState::Missing:
      return "missing";
    case CacheState::Stale:
      return "stale";
    case CacheState::Corrupt:
      return "corrupt";
    case CacheState::Foreign:
      return "foreign";
  }
  return "unknown";
}

BakeSettings read_bake_settings(const std::string& json, const fs::path& file) {
  const Json all = Json::parse(json, nullptr, false);
  BakeSettings s;
  if (all.is_object()) {
    const auto number = [&](const char* key, auto& target) {
      if (all.contains(key) && all[key].is_number()) target = all[key];
    };
    if (all.contains("cells") && all["cells"].is_array() && all["cells"].size() == 2 &&
        all["cells"][0].is_number_integer() && all["cells"][1].is_number_integer()) {
      s.gather.cells_theta = all["cells"][0];
      s.gather.cells_phi = all["cells"][1];
    }
    number("shells", s.gather.shells);
    number("footprint", s.gather.footprint);
    number("lamp_samples", s.gather.lamp_samples);
    number("step_voxels", s.gather.step_voxels);
    if (all.contains("gradient") && all["gradient"].is_string())
      s.gather.gradient = parse_gradient_mode(all["gradient"]);
    number("bounces", s.bounces);
    if (all.contains("volume_bounces") && all["volume_bounces"] == "auto")
      s.volume_bounces = kEveryOrder;
    else
      number("volume_bounces", s.volume_bounces);
    number("seed", s.seed);
    number("error", s.error);
    number("min_radius_m", s.min_radius);
    number("max_radius_m", s.max_radius);
    if (all.contains("light_depth"))
      s.light_depth = all["light_depth"] == "exact" ? LightDepth::Exact : LightDepth::Volumes;
  }
  // A round trip leaves no key unread.
  if (s.to_json() != json)
    throw Error(ErrorKind::InvalidInput,
                printable(file.string()) +
                    ": settings: written by another version of brume: bake it again");
  return s;
}

IrradianceCache cache_of(CacheContents& contents) {
  const Vec3d& origin = contents.header.origin;
  return {std::move(contents.records), origin, contents.curve_order,
          std::make_shared<VolumeCache>(std::move(contents.volume), origin)};
}

OpenedCache open_cache_of_world(const fs::path& file, const World& world) {
  CacheOpening opening = open_cache(file, std::nullopt);
  if (opening.state != CacheState::Loaded)
    throw Error(ErrorKind::InvalidInput, refusal(file, opening, "bake it again with `brume bake`"));
  const CacheHeader& header = opening.contents.header;
  const BakeSettings settings = read_bake_settings(header.settings, file);
  if (bake_fingerprint(world, settings) != header.fingerprint)
    throw Error(
        ErrorKind::InvalidInput,
        printable(file.string()) +
            ": stale: geometry, materials, lights or media are not those it was baked from: "
            "name its own scene, or bake it again");
  return {header, settings, cache_of(opening.contents)};
}

CacheSession::CacheSession(const CacheSettings& choice, const World& world,
                           const BakeSettings& settings)
    : file_(choice.file),
      mode_(choice.mode),
      settings_(settings),
      fingerprint_(bake_fingerprint(world, settings)) {
  if (!file_.empty() && mode_ != CacheMode::New) read();
}

void CacheSession::read() {
  identity_ = identity_of(file_);
  CacheOpening opening = open_cache(file_, fingerprint_);
  switch (opening.state) {
    case CacheState::Loaded: {
      CacheContents& contents = opening.contents;
      notes_ = contents.notes;
      existing_ = std::make_shared<IrradianceCache>(cache_of(contents));
      shards_ = contents.header.shards;
      is_on_disk_ = true;
      return;
    }
    case CacheState::Missing:
      if (mode_ != CacheMode::Read) return;
      throw Error(ErrorKind::InvalidInput,
                  refusal(file_, opening, "bake it first, or use --cache-mode missing"));
    case CacheState::Stale:
      throw Error(ErrorKind::InvalidInput,
                  printable(file_.string()) + ": stale: " + opening.reason +
                      settings_difference(file_, settings_) +
                      ": use the settings and scene it was baked with, or --cache-mode new to "
                      "replace it");
    case CacheState::Corrupt:
    case CacheState::Foreign:
      throw Error(
          ErrorKind::InvalidInput,
          refusal(file_, opening, "name another file, or use --cache-mode new to replace it"));
  }
}

CacheHeader CacheSession::header(const Vec3d& origin) const {
  CacheHeader header;
  header.fingerprint = fingerprint_;
  header.origin = origin;
  header.settings = settings_.to_json();
  header.creator = program_version();
  return header;
}

bool CacheSession::needs_bake(const World& world, const BakeRequest& request) const {
  if (mode_ != CacheMode::Missing || !existing_ || has_part(file_)) return may_bake();
  if (needs_deep_bake(world, settings_, existing_.get())) return true;
  if (request.deep_only) return false;
  if (request.shard.count > 1 && shards_.count > 0) return !holds_shard(shards_, request);
  if (shards_.count > 0 || has_unfinished(*existing_)) return true;
  return measure_coverage(world, settings_, *existing_, request).uncovered > 0;
}

void CacheSession::begin(const World& world, const JournalOptions& options, BakeRequest& request) {
  if (file_.empty() || !may_bake()) return;
  JournalOptions opened = options;
  opened.starts_anew = mode_ == CacheMode::New;
  journal_ = std::make_unique<CacheJournal>(
      file_, header(existing_ ? existing_->origin() : bake_origin(world)), opened);
  // Another bake may have come to its end since the file was read.
  if (mode_ != CacheMode::New && identity_of(file_) != identity_) {
    existing_.reset();
    read();
  }
  request.journal = journal_.get();
}

bool CacheSession::save(const BakeResult& baked, const BakeRequest& request,
                        const std::optional<CheckedRequest>& checked) {
  if (!journal_) return false;
  const ShardSet shards = shards_after(shards_, request, baked.is_stopped);
  CacheHeader file_header = header(baked.cache->origin());
  std::shared_ptr<const IrradianceCache> cache = baked.cache;
  if (shards.missing().empty() && shards.count > 0) {
    // The last of them: what one process would have made.
    std::vector<SurfaceRecord> records(cache->records().begin(), cache->records().end());
    mark_finished(records);
    cache = std::make_shared<IrradianceCache>(std::move(records), cache->origin(),
                                              std::span<const std::uint32_t>(), cache->volume());
  } else {
    file_header.shards = shards;
  }
  const bool is_changed =
      !existing_ || !has_same_records(*existing_, *cache) || shards_ != file_header.shards;
  // A stopped bake that has nothing yet makes no cache of that, and replaces none by it.
  const bool is_written = is_changed && !(baked.is_stopped && cache->size() == 0);
  if (is_written) {
    write_cache(file_, file_header, *cache, notes(baked.deep, checked), journal_.get());
    is_on_disk_ = true;
  }
  if (baked.is_stopped)
    journal_->seal();
  else
    journal_->remove();
  return is_written;
}

std::optional<CheckedRequest> CacheSession::known_check(std::uint64_t request) const {
  for (CheckedRequest& checked : read_checks(notes_.checks))
    if (checked.request == request) return std::move(checked);
  return std::nullopt;
}

CacheNotes CacheSession::notes(const DeepStats& deep,
                               const std::optional<CheckedRequest>& checked) const {
  CacheNotes notes = notes_;
  if (deep.is_solved()) notes.solve = deep.to_json();
  if (checked) notes.checks = checks_text(united(read_checks(notes.checks), {*checked}));
  return notes;
}

void CacheSession::save_snapshot(const IrradianceCache& cache, const DeepStats& deep) const {
  CacheHeader file_header = header(cache.origin());
  file_header.shards = shards_;
  write_cache(file_, file_header, cache, notes(deep, std::nullopt), journal_.get());
}

std::optional<fs::path> CacheSession::checkpoint() const {
  if (is_on_disk_) return file_;
  if (journal_ && !journal_->is_empty()) return journal_->part();
  return std::nullopt;
}

bool has_checkpoint(const CacheSettings& choice) {
  std::error_code ignored;
  return !choice.file.empty() && choice.mode != CacheMode::New &&
         (fs::is_regular_file(choice.file, ignored) || has_part(choice.file));
}

}  // namespace brume
