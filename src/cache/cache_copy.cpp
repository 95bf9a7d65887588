#include "cache/cache_copy.h"

#include <algorithm>

#include "cache/irradiance_cache.h"
#include "core/error.h"

namespace brume {
namespace {

bool is_one_batch(const SurfaceRecord& a, const SurfaceRecord& b) {
  return a.layer() == b.layer() && a.wave() == b.wave();
}

bool are_batches(const std::vector<SurfaceRecord>& records, const std::vector<std::size_t>& ends) {
  std::size_t begin = 0;
  for (const std::size_t end : ends) {
    if (end <= begin || end > records.size()) return false;
    for (std::size_t i = begin + 1; i < end; ++i)
      if (!is_one_batch(records[i - 1], records[i]) || RecordOrder{}(records[i], records[i - 1]))
        return false;
    begin = end;
  }
  return begin == records.size();
}

}  // namespace

std::vector<std::size_t> standard_batch_ends(const std::vector<SurfaceRecord>& records) {
  std::vector<std::size_t> ends;
  for (std::size_t i = 0; i < records.size(); ++i)
    if (i + 1 == records.size() || !is_one_batch(records[i], records[i + 1])) ends.push_back(i + 1);
  return ends;
}

std::vector<std::uint32_t> lookup_order(const std::vector<SurfaceRecord>& records,
                                        const Vec3d& origin) {
  const IrradianceCache cache(records, origin);
  std::vector<std::uint32_t> all;
  for (int layer = 0; layer < cache.layers(); ++layer)
    for (const std::uint32_t index : cache.curve_order(layer)) all.push_back(index);
  return all;
}

void write_cache_contents(const std::filesystem::path& file, CacheContents contents) {
  std::vector<SurfaceRecord>& records = contents.records;
  for (std::size_t i = 0; i < records.size(); ++i)
    if (const char* fault = record_fault(records[i]))
      throw Error(ErrorKind::InvalidInput, printable(file.string()) + ": record " +
                                               std::to_string(i) + ": " + fault + ": leave it out");
  if (!are_batches(records, contents.batch_ends)) {
    std::stable_sort(records.begin(), records.end(), RecordOrder{});
    contents.batch_ends = standard_batch_ends(records);
  }
  VolumeRecords& volume = contents.volume;
  for (std::size_t i = 0; i < volume.size(); ++i)
    if (const char* fault = record_fault(volume.records[i], volume.moments_of(i)))
      throw Error(ErrorKind::InvalidInput, printable(file.string()) + ": volume record " +
                                               std::to_string(i) + ": " + fault +
                                               ": bake the cache again");
  volume.sort();
  contents.header.volume_order = volume_order_of(volume);
  CacheWriter writer(file, contents.header);
  std::size_t begin = 0;
  bool is_deep_sealed = false;
  const auto end_deep = [&] {
    if (!is_deep_sealed) writer.seal_deep(volume, contents.notes.solve);
    is_deep_sealed = true;
  };
  for (const std::size_t end : contents.batch_ends) {
    if (records[begin].layer() != kDeepLayer) end_deep();
    writer.seal({records.begin() + static_cast<std::ptrdiff_t>(begin),
                 records.begin() + static_cast<std::ptrdiff_t>(end)});
    begin = end;
  }
  end_deep();
  writer.seal_checks(contents.notes.checks);
  if (!contents.curve_order.empty()) {  // As it was for other records: a part has its own.
    const IrradianceCache cache(std::move(records), contents.header.origin);
    for (int layer = 0; layer < cache.layers(); ++layer)
      if (const auto order = cache.curve_order(layer); !order.empty())
        writer.seal_order(layer, order);
  }
  writer.finish();
}

}  // namespace brume
