#include "cli/cache_input.h"

#include <cstdio>

#include "cli/cache_session.h"
#include "core/error.h"

namespace brume {

CacheContents read_cache_contents(const std::filesystem::path& file) {
  CacheOpening opening = open_cache(file, std::nullopt);
  if (opening.state == CacheState::Loaded) return std::move(opening.contents);
  std::string message =
      printable(file.string()) + ": " + cache_state_name(opening.state) + ": " + opening.reason;
  if (opening.state == CacheState::Corrupt)
    message += ": save what is left of it with `brume filter --salvage`, or bake it again";
  throw Error(ErrorKind::InvalidInput, message);
}

Json settings_json(const std::string& text) {
  Json settings = Json::parse(text, nullptr, false);
  return settings.is_discarded() ? Json(printable(text)) : settings;
}

std::string shown_key(std::uint64_t key) {
  char text[20];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(key));
  return text;
}

}  // namespace brume
