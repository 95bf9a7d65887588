// The fields of records by name, for every format that writes them as text or as attributes.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "cache/record.h"

namespace brume {

// A field of floats. Flags and key are in every record and no columns.
struct RecordColumn {
  const char* name;
  std::size_t offset;              // In the record.
  std::vector<std::string> parts;  // One a float; a single "" for a scalar.

  std::size_t size() const { return parts.size(); }
  std::string full_name(std::size_t part) const {
    return parts[part].empty() ? name : std::string(name) + "." + parts[part];
  }
};

// In order of offset; together with flags and key they are the whole record.
std::span<const RecordColumn> surface_columns();

inline constexpr const char* kSurfaceKind = "surface";

}  // namespace brume
