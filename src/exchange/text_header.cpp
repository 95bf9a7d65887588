#include "exchange/text_header.h"

#include <charconv>
#include <nlohmann/json.hpp>

#include "cache/cache_copy.h"
#include "core/error.h"

namespace brume {
namespace {

using Json = nlohmann::ordered_json;

std::optional<Fingerprint> parse_fingerprint(const std::string& hex) {
  if (hex.size() != 32) return std::nullopt;
  Fingerprint fingerprint;
  for (std::size_t w = 0; w < 2; ++w) {
    const char* const begin = hex.data() + 16 * w;
    const auto [stopped, problem] = std::from_chars(begin, begin + 16, fingerprint.words[w], 16);
    if (problem != std::errc() || stopped != begin + 16) return std::nullopt;
  }
  return fingerprint;
}

}  // namespace

std::string text_header_line(const CacheContents& contents) {
  const CacheHeader& header = contents.header;
  Json object = Json::object();
  object["brume_cache"] = kTextVersion;
  object["fingerprint"] = header.fingerprint.hex();
  object["origin"] = {header.origin.x, header.origin.y, header.origin.z};
  object["settings"] = header.settings;
  object["creator"] = header.creator;
  object["records"] = contents.records.size();
  if (!contents.notes.solve.empty()) object["solve"] = contents.notes.solve;
  if (!contents.notes.checks.empty()) object["checks"] = contents.notes.checks;
  if (header.shards.count > 0)
    object["shards"] = {{"request", header.shards.request},
                        {"count", header.shards.count},
                        {"done", header.shards.done}};
  object["lookup_order"] = !contents.curve_order.empty();
  if (contents.batch_ends != standard_batch_ends(contents.records)) {
    object["batches"] = Json::array();
    std::size_t begin = 0;
    for (const std::size_t end : contents.batch_ends) {
      object["batches"].push_back(end - begin);
      begin = end;
    }
  }
  // Settings are somebody's text: a byte that is no UTF-8 must not stop an export.
  return object.dump(-1, ' ', false, Json::error_handler_t::replace);
}

TextHeader parse_text_header(const std::string& line, const std::string& place) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ErrorKind::InvalidInput, place + ": " + what +
                                             ": the first line of a cache as text is written by "
                                             "`brume convert`");
  };
  const Json object = Json::parse(line, nullptr, false);
  if (!object.is_object() || !object.contains("brume_cache")) refuse("no header of a cache");
  if (object["brume_cache"] != kTextVersion)
    refuse("version " + printable(object["brume_cache"].dump(), 20) + " of the text, not " +
           std::to_string(kTextVersion));
  const auto text = [&](const char* key) {
    if (!object.contains(key) || !object[key].is_string()) refuse(std::string(key) + " is no text");
    return object[key].get<std::string>();
  };
  TextHeader result;
  CacheHeader& header = result.header;
  header.settings = text("settings");
  header.creator = text("creator");
  if (header.settings.size() > CacheHeader::kMaxSettingsBytes ||
      header.creator.size() > CacheHeader::kMaxCreatorBytes)
    refuse("settings or creator are too long");
  for (const std::string& value : {header.settings, header.creator})
    for (const char c : value)
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f)
        refuse("settings or creator hold control characters");
  const auto fingerprint = parse_fingerprint(text("fingerprint"));
  if (!fingerprint) refuse("fingerprint is not 32 hexadecimal digits");
  header.fingerprint = *fingerprint;
  const Json origin = object.value("origin", Json());
  if (!origin.is_array() || origin.size() != 3) refuse("origin is not three numbers");
  for (int a = 0; a < 3; ++a) {
    const Json& number = origin[static_cast<std::size_t>(a)];
    if (!number.is_number() || !std::isfinite(number.get<double>()))
      refuse("origin is not three numbers");
    header.origin[a] = number.get<double>();
  }
  if (object.contains("shards")) {
    const Json& shards = object["shards"];
    const auto count = [&](const char* key) -> std::uint64_t {
      if (!shards.is_object() || !shards.contains(key) || !shards[key].is_number_unsigned())
        refuse(std::string("shards: ") + key + " is no count");
      return shards[key].get<std::uint64_t>();
    };
    header.shards.request = count("request");
    header.shards.count = static_cast<std::uint32_t>(
        std::min<std::uint64_t>(count("count"), ShardSet::kMaxShards + 1));
    for (const Json& number : shards.value("done", Json::array())) {
      if (!number.is_number_unsigned()) refuse("shards: done holds no counts");
      header.shards.done.push_back(static_cast<std::uint32_t>(
          std::min<std::uint64_t>(number.get<std::uint64_t>(), ShardSet::kMaxShards)));
    }
    if (!header.shards.is_valid()) refuse("shards are not parts of one bake");
  }
  if (object.contains("solve")) result.notes.solve = text("solve");
  if (object.contains("checks")) result.notes.checks = text("checks");
  result.has_lookup_order = object.value("lookup_order", Json(false)) == Json(true);
  if (object.contains("records")) {
    if (!object["records"].is_number_unsigned()) refuse("records is no count");
    result.records = object["records"].get<std::size_t>();
  }
  std::size_t end = 0;
  for (const Json& count : object.value("batches", Json::array())) {
    if (!count.is_number_unsigned()) refuse("batches are no counts");
    result.batch_ends.push_back(end += count.get<std::size_t>());
  }
  return result;
}

}  // namespace brume
