#include <cstring>

#include "bake/light_transport.h"

namespace brume {
namespace {

struct RowHeader {
  std::uint32_t numbers, strata, points, reserved;
  double nearest, error;
};

template <typename T>
void append(std::vector<unsigned char>& bytes, const std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  const auto* first = reinterpret_cast<const unsigned char*>(values.data());
  bytes.insert(bytes.end(), first, first + values.size() * sizeof(T));
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
                         row.error};
  std::vector<unsigned char> bytes;
  append(bytes, std::vector<RowHeader>{header});
  append(bytes, row.unreflected);
  append(bytes, row.reflected);
  append(bytes, row.strata.strata);
  append(bytes, row.strata.points);
  return bytes;
}

std::optional<DeepRow> row_of(std::span<const unsigned char> bytes) {
  RowHeader header{};
  if (bytes.size() < sizeof header) return std::nullopt;
  std::memcpy(&header, bytes.data(), sizeof header);
  bytes = bytes.subspan(sizeof header);
  if (header.numbers == 0 ||
      bytes.size() < 2 * sizeof(RgbD) * std::uint64_t(header.numbers) +
                         sizeof(Stratum) * std::uint64_t(header.strata) +
                         sizeof(MediumPoint) * std::uint64_t(header.points))
    return std::nullopt;
  DeepRow row;
  row.nearest = header.nearest;
  row.error = header.error;
  take(bytes, header.numbers, row.unreflected);
  take(bytes, header.numbers, row.reflected);
  take(bytes, header.strata, row.strata.strata);
  take(bytes, header.points, row.strata.points);
  std::uint32_t end = 0;
  for (const Stratum& s : row.strata.strata) {
    if (s.points_end < end || s.points_end > header.points) return std::nullopt;
    end = s.points_end;
  }
  return row;
}

}  // namespace brume
