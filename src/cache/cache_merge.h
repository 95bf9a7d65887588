// Caches of one bake made into one: shards, or the same work done twice.
#pragma once

#include <filesystem>
#include <vector>

#include "cache/cache_file.h"

namespace brume {

struct MergeInput {
  std::filesystem::path file;  // For messages.
  CacheContents contents;      // Loaded.
};

struct MergedCache {
  CacheHeader header;  // `shards` is empty where none is missing.
  std::vector<SurfaceRecord> records;
  VolumeRecords volume;
  CacheNotes notes;
  std::size_t repeated = 0;  // Records that more than one input held.
  ShardSet shards;           // Of the inputs together; its missing() is still to be baked.
};

// The same for any order of `inputs`, of which there is at least one. With all shards it is, to the
// bit, what one process bakes; without some, what a stopped one leaves. Throws Error(InvalidInput)
// naming the files for other fingerprints, shards of different bakes, or records of one key with
// different bits, which the bake's promise rules out: a broken machine, or another build.
MergedCache merge_caches(const std::vector<MergeInput>& inputs);

// Every cell of what the records were baked for is there: they are as good as any.
void mark_finished(std::vector<SurfaceRecord>& records);

}  // namespace brume
