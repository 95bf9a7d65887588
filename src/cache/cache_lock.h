// One writer at a time for FILE: an exclusive lock on FILE.part. Private to cache/.
#pragma once

#include <filesystem>

#include "cache/posix_file.h"

namespace brume {

std::filesystem::path part_of(const std::filesystem::path& file);

// Opens FILE.part, creating it where there is none, and locks it. The kernel drops the lock of a
// process that dies, so a part without a lock has no writer. Throws Error(Stopped) while somebody
// holds it, Error(Resource) for a place that cannot be written.
PosixFile lock_part(const std::filesystem::path& file);

// Removes a part that holds nothing.
void remove_empty_part(const PosixFile& part);

}  // namespace brume
