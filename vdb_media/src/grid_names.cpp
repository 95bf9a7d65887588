#include "grid_names.h"

#include <algorithm>
#include <array>
#include <charconv>

#include "core/error.h"

namespace brume {
namespace {

// ASCII only, and the same in every locale.
std::string lower(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

std::vector<std::size_t> entries_named(const std::vector<GridEntry>& entries,
                                       const std::string& name, bool match_case) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < entries.size(); ++i)
    if (match_case ? entries[i].name == name : lower(entries[i].name) == lower(name))
      found.push_back(i);
  return found;
}

struct IndexedName {
  std::string base;
  std::size_t index;
};

std::optional<IndexedName> parse_indexed(const std::string& name) {
  const std::size_t open = name.rfind('[');
  if (open == std::string::npos || open == 0 || name.back() != ']') return std::nullopt;
  const char *begin = name.data() + open + 1, *end = name.data() + name.size() - 1;
  std::size_t index = 0;
  const auto [stop, error] = std::from_chars(begin, end, index);
  if (error != std::errc() || stop != end || begin == end) return std::nullopt;
  return IndexedName{name.substr(0, open), index};
}

[[noreturn]] void refuse(const std::string& file, const std::string& what) {
  throw Error(ErrorKind::InvalidInput, file + ": " + what);
}

// The one entry that a name means, written exactly so or, failing that, without regard to case.
std::optional<std::size_t> entry_named(const std::string& file,
                                       const std::vector<GridEntry>& entries,
                                       const std::string& name) {
  for (const bool match_case : {true, false}) {
    const auto found = entries_named(entries, name, match_case);
    if (found.size() == 1) return found.front();
    if (found.size() > 1) {
      std::string places;
      for (const std::size_t i : found)
        places += (places.empty() ? "" : ", ") + display_name(entries, i);
      refuse(file, "grid " + printable(name) + ": " + std::to_string(found.size()) +
                       " grids go by this name: ask for one of " + places);
    }
  }
  return std::nullopt;
}

std::string join(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

// What somebody who has only this file can do about it.
std::string advice(const std::vector<GridEntry>& entries, GridRole role) {
  const auto fits = [&](const GridEntry& e) {
    const bool vector = e.type.starts_with("vec");
    return !e.is_level_set && !e.type.starts_with("pt") && !is_velocity(e) &&
           (!vector || role == GridRole::Color || role == GridRole::Emission);
  };
  const auto it = std::find_if(entries.begin(), entries.end(), fits);
  if (it != entries.end()) {
    const auto index = static_cast<std::size_t>(it - entries.begin());
    return std::string("map it in the scene, as in \"grids\": {\"") + grid_role_name(role) +
           "\": \"" + display_name(entries, index) + "\"}";
  }
  if (std::any_of(entries.begin(), entries.end(),
                  [](const GridEntry& e) { return e.is_level_set; }))
    return "a level set is a surface, not fog: convert it to a fog volume (Houdini: Convert VDB; "
           "OpenVDB: sdfToFogVolume)";
  if (std::any_of(entries.begin(), entries.end(),
                  [](const GridEntry& e) { return e.type.starts_with("pt"); }))
    return "points are not supported: rasterise them to a fog volume first (Houdini: VDB "
           "Rasterize Points)";
  return "export the file with such a grid";
}

}  // namespace

const std::vector<std::string>& usual_grid_names(GridRole role) {
  static const std::array<std::vector<std::string>, 5> kNames{{
      {"density", "dens"},
      {"temperature", "temp", "heat"},
      {"flame", "flames", "burn"},
      {"emission"},
      {"Cd", "color", "albedo"},
  }};
  return kNames[static_cast<std::size_t>(role)];
}

const char* grid_role_name(GridRole role) {
  static constexpr std::array<const char*, 5> kNames{"density", "temperature", "flame", "emission",
                                                     "color"};
  return kNames[static_cast<std::size_t>(role)];
}

std::string display_name(const std::vector<GridEntry>& entries, std::size_t index) {
  const std::string name =
      entries[index].name.empty() ? "(unnamed)" : printable(entries[index].name);
  const auto same = entries_named(entries, entries[index].name, true);
  if (same.size() == 1) return name;
  const auto place = std::find(same.begin(), same.end(), index) - same.begin();
  return name + "[" + std::to_string(place) + "]";
}

std::string list_names(const std::vector<GridEntry>& entries) {
  constexpr std::size_t kShown = 12;
  std::string text;
  for (std::size_t i = 0; i < entries.size() && i < kShown; ++i)
    text += (i == 0 ? "" : ", ") + display_name(entries, i) + " (" + printable(entries[i].type) +
            (entries[i].is_level_set ? ", level set)" : ")");
  if (entries.size() > kShown) text += " and " + std::to_string(entries.size() - kShown) + " more";
  return text;
}

bool is_velocity(const GridEntry& entry) {
  const std::string name = lower(entry.name);
  return entry.type.starts_with("vec3") && (name == "v" || name == "vel" || name == "velocity");
}

std::optional<GridRole> usual_role(const std::string& name) {
  for (const GridRole role : {GridRole::Density, GridRole::Temperature, GridRole::Flame,
                              GridRole::Emission, GridRole::Color})
    for (const std::string& usual : usual_grid_names(role))
      if (lower(usual) == lower(name)) return role;
  return std::nullopt;
}

std::optional<std::size_t> choose_grid(const std::string& file,
                                       const std::vector<GridEntry>& entries,
                                       const GridRequest& request) {
  const std::string holds =
      entries.empty() ? "the file holds no grid" : "the file holds " + list_names(entries);
  if (request.name) {
    if (const auto entry = entry_named(file, entries, *request.name)) return entry;
    if (const auto indexed = parse_indexed(*request.name)) {
      const auto same = entries_named(entries, indexed->base, true);
      if (indexed->index < same.size()) return same[indexed->index];
    }
    if (!request.required) return std::nullopt;
    refuse(file, "grid " + printable(*request.name) + ": not in the file: " + holds);
  }
  for (const std::string& usual : usual_grid_names(request.role))
    if (const auto entry = entry_named(file, entries, usual)) return entry;
  if (!request.required) return std::nullopt;
  refuse(file, std::string("no ") + grid_role_name(request.role) + " grid (" +
                   join(usual_grid_names(request.role)) + "): " + holds + ": " +
                   advice(entries, request.role));
}

}  // namespace brume
