// A cache as text, for spreadsheets and scripts, and back without losing a bit.
#pragma once

#include <filesystem>
#include <optional>

#include "cache/cache_file.h"

namespace brume {

enum class TextFormat { Csv, JsonLines };

// By its first bytes; nothing for what is neither, or no regular file.
std::optional<TextFormat> text_format_of(const std::filesystem::path& file);

//   CSV         = "# " header LF  names LF  row*
//   JSON lines  = header LF  record*
//   header      = one JSON object: brume_cache (version of this text, 1), fingerprint, origin,
//   settings, creator,
//                 records (how many follow), batches (where they are not one for each layer and
//                 wave)
//   row, record = kind, key (16 hex digits), layer, wave, flags (bits 16 and up), then the floats
//   of
//                 surface_columns(), each with the fewest digits that give the same float back
// Written aside and renamed. Throws Error(Resource).
void write_text_records(const std::filesystem::path& file, TextFormat format,
                        const CacheContents& contents);

// Columns of a CSV may stand in any order. Throws Error(InvalidInput) naming the line for what is
// no such text, for a record_fault(), and where fewer or more records follow than the header tells
// of.
CacheContents read_text_records(const std::filesystem::path& file);

}  // namespace brume
