// Writes what one cache file held to another: the same contents give the same bytes.
#pragma once

#include <filesystem>

#include "cache/cache_file.h"

namespace brume {

// How write_cache_contents() cuts records into batches where `batch_ends` does not say: one for
// each layer and wave, as a bake does.
std::vector<std::size_t> standard_batch_ends(const std::vector<SurfaceRecord>& records);

// CacheContents::curve_order of records in RecordOrder.
std::vector<std::uint32_t> lookup_order(const std::vector<SurfaceRecord>& records,
                                        const Vec3d& origin);

// `contents` as a complete file, written aside and renamed. Records are sealed in the batches that
// `batch_ends` tells of; where those are not batches of these records (of one layer and wave, in
// order of keys) the records are sorted and standard_batch_ends() used. With a lookup order of these
// records where `contents` has one. Throws Error(InvalidInput) naming the first record with a
// record_fault(), Error(Resource) where it cannot write.
void write_cache_contents(const std::filesystem::path& file, CacheContents contents);

}  // namespace brume
