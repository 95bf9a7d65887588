// Bytes of what a journal keeps beside records.
#include <cstring>

#include "bake/light_solve.h"

namespace brume {
namespace {

struct RowHeader {
  std::uint32_t numbers, strata, points, reserved;
  double nearest, error, spread;
};

struct SolutionHeader {
  std::int32_t orders, scatterings, is_accelerated, applications;
  double ratio, truncation_bound;
  std::uint64_t strata, surface, moments, volume, changes;
};

template <typename T>
void append(std::vector<unsigned char>& bytes, std::span<const T> values) {
  static_assert(std::is_trivially_copyable_v<T>);
  const std::size_t before = bytes.size();
  bytes.resize(before + values.size_bytes());
  if (!values.empty()) std::memcpy(bytes.data() + before, values.data(), values.size_bytes());
}

template <typename Header>
std::optional<Header> take_header(std::span<const unsigned char>& bytes) {
  Header header{};
  if (bytes.size() < sizeof header) return std::nullopt;
  std::memcpy(&header, bytes.data(), sizeof header);
  bytes = bytes.subspan(sizeof header);
  return header;
}

template <typename T>
void take(std::span<const unsigned char>& bytes, std::size_t count, std::vector<T>& values) {
  values.resize(count);
  if (count > 0) std::memcpy(values.data(), bytes.data(), count * sizeof(T));
  bytes = bytes.subspan(count * sizeof(T));
}

}  // namespace

std::vector<unsigned char> bytes_of(const DeepRow& row) {
  const RowHeader header{static_cast<std::uint32_t>(row.unreflected.size()),
                         static_cast<std::uint32_t>(row.strata.strata.size()),
                         static_cast<std::uint32_t>(row.strata.points.size()),
                         0,
                         row.nearest,
                         row.error,
                         row.strata.spread};
  std::vector<unsigned char> bytes;
  append(bytes, std::span(&header, 1));
  append(bytes, std::span(row.unreflected));
  append(bytes, std::span(row.reflected));
  append(bytes, std::span(row.strata.strata));
  append(bytes, std::span(row.strata.points));
  return bytes;
}

std::optional<DeepRow> row_of(std::span<const unsigned char> bytes) {
  const auto header = take_header<RowHeader>(bytes);
  if (!header) return std::nullopt;
  if (header->numbers == 0 ||
      bytes.size() < 2 * sizeof(RgbD) * std::uint64_t(header->numbers) +
                         sizeof(Stratum) * std::uint64_t(header->strata) +
                         sizeof(MediumPoint) * std::uint64_t(header->points))
    return std::nullopt;
  DeepRow row;
  row.nearest = header->nearest;
  row.error = header->error;
  row.strata.spread = header->spread;
  take(bytes, header->numbers, row.unreflected);
  take(bytes, header->numbers, row.reflected);
  take(bytes, header->strata, row.strata.strata);
  take(bytes, header->points, row.strata.points);
  std::uint32_t end = 0;
  for (const Stratum& s : row.strata.strata) {
    if (s.points_end < end || s.points_end > header->points) return std::nullopt;
    end = s.points_end;
  }
  return row;
}

std::vector<unsigned char> bytes_of(const DeepSolution& s) {
  const SolutionHeader header{s.orders,
                              s.scatterings,
                              s.is_accelerated,
                              s.applications,
                              s.ratio,
                              s.truncation_bound,
                              s.strata,
                              s.light.surface.size(),
                              s.light.volume.size(),
                              s.reflected_fluence.size(),
                              s.changes.size()};
  std::vector<unsigned char> bytes;
  append(bytes, std::span(&header, 1));
  append(bytes, std::span(s.light.surface));
  append(bytes, std::span(s.before));
  append(bytes, std::span(s.light.volume));
  append(bytes, std::span(s.reflected_fluence));
  append(bytes, std::span(s.changes));
  return bytes;
}

std::optional<DeepSolution> solution_of(std::span<const unsigned char> bytes) {
  const auto header = take_header<SolutionHeader>(bytes);
  if (!header) return std::nullopt;
  for (const std::uint64_t count :
       {header->surface, header->moments, header->volume, header->changes})
    if (count > bytes.size()) return std::nullopt;
  if (bytes.size() < sizeof(RgbD) * (2 * header->surface + header->moments + header->volume) +
                         sizeof(double) * header->changes)
    return std::nullopt;
  DeepSolution s;
  take(bytes, header->surface, s.light.surface);
  take(bytes, header->surface, s.before);
  take(bytes, header->moments, s.light.volume);
  take(bytes, header->volume, s.reflected_fluence);
  take(bytes, header->changes, s.changes);
  s.orders = header->orders;
  s.scatterings = header->scatterings;
  s.is_accelerated = header->is_accelerated != 0;
  s.applications = header->applications;
  s.ratio = header->ratio;
  s.truncation_bound = header->truncation_bound;
  s.strata = header->strata;
  return s;
}

}  // namespace brume
