#include "cli/cache_session.h"

#include <nlohmann/json.hpp>

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

CacheHeader make_header(const Fingerprint& fingerprint, const BakeSettings& settings,
                        const IrradianceCache& cache) {
  CacheHeader header;
  header.fingerprint = fingerprint;
  header.origin = cache.origin();
  header.settings = settings.to_json();
  header.creator = program_version();
  return header;
}

// One seal for each run of one layer and wave; the records are in RecordOrder already.
void write_cache(const fs::path& file, const CacheHeader& header, const IrradianceCache& cache) {
  CacheWriter writer(file, header);
  const auto records = cache.records();
  for (auto run = records.begin(); run != records.end();) {
    auto end = run;
    while (end != records.end() && end->layer() == run->layer() && end->wave() == run->wave())
      ++end;
    writer.seal({run, end});
    run = end;
  }
  writer.finish();
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
    number("step_voxels", s.gather.step_voxels);
    if (all.contains("gradient") && all["gradient"].is_string())
      s.gather.gradient = parse_gradient_mode(all["gradient"]);
    number("bounces", s.bounces);
    number("volume_bounces", s.volume_bounces);
    number("seed", s.seed);
    number("error", s.error);
    number("min_radius", s.min_radius);
    number("max_radius", s.max_radius);
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

OpenedCache open_cache_of_world(const fs::path& file, const World& world) {
  const CacheOpening opening = open_cache(file, std::nullopt);
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
  return {header, settings, IrradianceCache(opening.contents.records, header.origin)};
}

CacheSession::CacheSession(const CacheSettings& choice, const World& world,
                           const BakeSettings& settings)
    : file_(choice.file),
      mode_(choice.mode),
      settings_(settings),
      fingerprint_(bake_fingerprint(world, settings)) {
  if (file_.empty() || mode_ == CacheMode::New) return;
  const CacheOpening opening = open_cache(file_, fingerprint_);
  switch (opening.state) {
    case CacheState::Loaded:
      existing_ = std::make_shared<IrradianceCache>(opening.contents.records,
                                                    opening.contents.header.origin);
      return;
    case CacheState::Missing:
      if (mode_ != CacheMode::Read) return;
      throw Error(ErrorKind::InvalidInput,
                  refusal(file_, opening, "bake it first, or use --cache-mode missing"));
    case CacheState::Stale:
      throw Error(ErrorKind::InvalidInput,
                  printable(file_.string()) + ": stale: " + opening.reason +
                      settings_difference(file_, settings) +
                      ": use the settings and scene it was baked with, or --cache-mode new to "
                      "replace it");
    case CacheState::Corrupt:
    case CacheState::Foreign:
      throw Error(
          ErrorKind::InvalidInput,
          refusal(file_, opening, "name another file, or use --cache-mode new to replace it"));
  }
}

bool CacheSession::needs_bake(const World& world, const BakeRequest& request) const {
  if (mode_ != CacheMode::Missing || !existing_) return may_bake();
  return measure_coverage(world, settings_, *existing_, request).uncovered > 0;
}

bool CacheSession::save(const IrradianceCache& cache, std::size_t added) const {
  if (file_.empty() || !may_bake()) return false;
  if (existing_ && added == 0) return false;
  write_cache(file_, make_header(fingerprint_, settings_, cache), cache);
  return true;
}

}  // namespace brume
