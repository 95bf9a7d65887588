// The first line of a cache written as text: what is not in its records. Private to exchange/.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "cache/cache_file.h"

namespace brume {

struct TextHeader {
  CacheHeader header;
  std::optional<std::size_t> records;
  std::vector<std::size_t> batch_ends;  // Empty: one batch for each layer and wave.
  bool has_lookup_order = false;
  CacheNotes notes;
};

inline constexpr int kTextVersion = 1;

// One line of JSON without its end.
std::string text_header_line(const CacheContents& contents);
// `place` names file and line. Throws Error(InvalidInput).
TextHeader parse_text_header(const std::string& line, const std::string& place);

}  // namespace brume
