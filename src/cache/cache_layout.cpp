#include "cache/cache_layout.h"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>

#include "core/error.h"

namespace brume::cache_layout {
namespace {

// Like PNG's: bytes that a transfer as text, to 7 bits or with other line ends, would change.
constexpr unsigned char kMagic[8] = {0x89, 'I', 'R', 'C', '\r', '\n', 0x1a, '\n'};
constexpr char kBlockMagic[4] = {'I', 'R', 'C', 'B'}, kFooterMagic[4] = {'I', 'R', 'C', 'F'};
constexpr std::uint32_t kEndianMark = 0x01020304;

// Offsets in the file header.
constexpr std::size_t kVersionAt = 8, kEndianAt = 12, kHeaderBytesAt = 16, kBlockRecordsAt = 20,
                      kKindBytesAt = 24, kRequiredAt = 40, kFieldCountAt = 44, kFingerprintAt = 48,
                      kOriginAt = 64, kSettingsBytesAt = 88, kCreatorAt = 96, kSchemaAt = 128,
                      kSettingsAt = 1024, kRequestAt = 3560, kShardCountAt = 3568, kShardsAt = 3576,
                      kSumAt = kHeaderBytes - 8;
constexpr std::size_t kCreatorBytes = kSchemaAt - kCreatorAt, kFieldBytes = 40,
                      kMaxFields = (kSettingsAt - kSchemaAt) / kFieldBytes;
// Until minor version 1 nothing followed the settings.
constexpr std::size_t kMaxSettingsBytesOfMinor0 = kSumAt - kSettingsAt;
static_assert(CacheHeader::kMaxSettingsBytes == kRequestAt - kSettingsAt);
static_assert(ShardSet::kMaxShards == 8 * (kSumAt - kShardsAt));
static_assert(CacheHeader::kMaxCreatorBytes == kCreatorBytes);

struct Field {
  const char* name;  // At most 15 characters.
  const char* unit;  // At most 11.
  const char* type;  // At most 3.
  RecordKind kind;
  std::size_t offset, count;
};
#define BRUME_FIELD(kind, name, unit, type, count) \
  Field { #name, unit, type, RecordKind::kind, offsetof(kind##Record, name), count }
constexpr Field kSurfaceFields[] = {
    BRUME_FIELD(Surface, position, "world", "f32", 3),
    BRUME_FIELD(Surface, normal, "1", "f32", 3),
    BRUME_FIELD(Surface, irradiance, "W/m^2", "f32", 3),
    BRUME_FIELD(Surface, gradient, "W/m^2/world", "f32", 9),
    BRUME_FIELD(Surface, rotational, "W/m^2", "f32", 6),
    BRUME_FIELD(Surface, axis, "rad", "f32", 1),
    BRUME_FIELD(Surface, radius, "world", "f32", 2),
    BRUME_FIELD(Surface, error, "W/m^2", "f32", 1),
    BRUME_FIELD(Surface, media_share, "1", "f32", 1),
    BRUME_FIELD(Surface, flags, "bits", "u32", 1),
    BRUME_FIELD(Surface, key, "hash", "u64", 1),
};
// Before the moments, whose count follows from their order.
constexpr Field kVolumeFields[] = {
    BRUME_FIELD(Volume, position, "world", "f32", 3),
    BRUME_FIELD(Volume, radius, "world", "f32", 3),
    BRUME_FIELD(Volume, axes, "1", "f32", 4),
    BRUME_FIELD(Volume, error, "W/m^2", "f32", 1),
    BRUME_FIELD(Volume, media_share, "1", "f32", 1),
    BRUME_FIELD(Volume, flags, "bits", "u32", 1),
    BRUME_FIELD(Volume, clearance, "world", "f32", 1),
    BRUME_FIELD(Volume, key, "hash", "u64", 1),
};
#undef BRUME_FIELD
static_assert(std::size(kSurfaceFields) + std::size(kVolumeFields) + 1 <= kMaxFields);

// In the table, of files with these records of the medium.
std::vector<Field> fields_of(int volume_order) {
  std::vector<Field> fields(std::begin(kSurfaceFields), std::end(kSurfaceFields));
  if (volume_order == kNoVolumeRecords) return fields;
  fields.insert(fields.end(), std::begin(kVolumeFields), std::end(kVolumeFields));
  fields.push_back({"moments", "W/m^2", "f32", RecordKind::Volume, sizeof(VolumeRecord),
                    3 * static_cast<std::size_t>(harmonic_count(volume_order))});
  return fields;
}

template <typename T>
void put(unsigned char* bytes, std::size_t at, const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::memcpy(bytes + at, &value, sizeof value);
}
template <typename T>
T get(const unsigned char* bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes + at, sizeof value);
  return value;
}

void put_schema(const std::vector<Field>& fields, unsigned char* bytes) {
  for (const Field& field : fields) {
    std::memcpy(bytes, field.name, std::strlen(field.name));
    std::memcpy(bytes + 16, field.unit, std::strlen(field.unit));
    std::memcpy(bytes + 28, field.type, std::strlen(field.type));
    put(bytes, 32, static_cast<std::uint16_t>(field.kind));
    put(bytes, 34, static_cast<std::uint16_t>(field.offset));
    put(bytes, 36, static_cast<std::uint16_t>(field.count));
    bytes += kFieldBytes;
  }
}

bool is_text(const std::string& text) {
  return std::all_of(text.begin(), text.end(), [](char c) {
    return static_cast<unsigned char>(c) >= 0x20 && c != 0x7f;
  });
}

// Our magic after line ends were changed or the eighth bits taken off.
bool is_magic_as_text(const std::vector<unsigned char>& bytes) {
  std::string visible;
  for (std::size_t i = 0; i < bytes.size() && visible.size() < 5; ++i)
    if (bytes[i] != '\r' && bytes[i] != '\n') visible += static_cast<char>(bytes[i]);
  return visible == "\x89IRC\x1a" || visible == "\tIRC\x1a";
}

// Whether the table of fields begins with these.
bool has_fields(const unsigned char* bytes, const std::vector<Field>& fields) {
  const auto count = get<std::uint32_t>(bytes, kFieldCountAt);
  std::vector<unsigned char> schema(fields.size() * kFieldBytes, 0);
  put_schema(fields, schema.data());
  return count >= fields.size() && count <= kMaxFields &&
         std::equal(schema.begin(), schema.end(), bytes + kSchemaAt);
}

// Why the first eight bytes are not the magic; empty where they are.
std::pair<CacheState, std::string> check_magic(const std::vector<unsigned char>& bytes) {
  const std::size_t present = std::min(bytes.size(), sizeof kMagic);
  if (std::equal(kMagic, kMagic + present, bytes.begin())) {
    if (present == sizeof kMagic) return {CacheState::Loaded, ""};
    return {CacheState::Corrupt, bytes.empty() ? "the file is empty" : "the file ends in its header"};
  }
  if (is_magic_as_text(bytes))
    return {CacheState::Corrupt, "damaged by a transfer as text; transfer it as binary"};
  return {CacheState::Foreign, "not a brume cache"};
}

}  // namespace

std::size_t volume_record_file_bytes(int order) {
  return (volume_record_bytes(order) + kOffsetUnit - 1) / kOffsetUnit * kOffsetUnit;
}

HeaderBytes encode_header(const CacheHeader& header) {
  if (header.settings.size() > CacheHeader::kMaxSettingsBytes || !is_text(header.settings))
    throw Error(ErrorKind::Internal,
                "cache header: settings must be one line of at most " +
                    std::to_string(CacheHeader::kMaxSettingsBytes) + " bytes, not " +
                    std::to_string(header.settings.size()));
  if (header.creator.size() > kCreatorBytes || !is_text(header.creator))
    throw Error(ErrorKind::Internal, "cache header: creator must be one line of at most " +
                                         std::to_string(kCreatorBytes) + " bytes");
  if (!is_finite(header.origin))
    throw Error(ErrorKind::Internal, "cache header: origin is not finite");
  if (!header.shards.is_valid())
    throw Error(ErrorKind::Internal, "cache header: shards that are none of theirs");
  HeaderBytes result{};
  unsigned char* bytes = result.data();
  std::copy(std::begin(kMagic), std::end(kMagic), bytes);
  put(bytes, kVersionAt, kMajor);
  put(bytes, kVersionAt + 2, kMinor);
  put(bytes, kEndianAt, kEndianMark);
  put(bytes, kHeaderBytesAt, static_cast<std::uint32_t>(kHeaderBytes));
  put(bytes, kBlockRecordsAt, static_cast<std::uint32_t>(CacheWriter::kBlockRecords));
  put(bytes, kKindBytesAt, static_cast<std::uint32_t>(sizeof(SurfaceRecord)));
  if (header.volume_order != kNoVolumeRecords)
    put(bytes, kKindBytesAt + 4,
        static_cast<std::uint32_t>(volume_record_file_bytes(header.volume_order)));
  put(bytes, kKindBytesAt + 8,
      static_cast<std::uint32_t>(kIndicesPerOrder * sizeof(std::uint32_t)));
  put(bytes, kKindBytesAt + 12, kNoteUnitBytes);
  const std::vector<Field> fields = fields_of(header.volume_order);
  put(bytes, kFieldCountAt, static_cast<std::uint32_t>(fields.size()));
  put(bytes, kFingerprintAt, header.fingerprint.words);
  for (std::size_t a = 0; a < 3; ++a)
    put(bytes, kOriginAt + 8 * a, header.origin[static_cast<int>(a)]);
  put(bytes, kSettingsBytesAt, static_cast<std::uint32_t>(header.settings.size()));
  std::copy(header.creator.begin(), header.creator.end(), bytes + kCreatorAt);
  put_schema(fields, bytes + kSchemaAt);
  std::copy(header.settings.begin(), header.settings.end(), bytes + kSettingsAt);
  put(bytes, kRequestAt, header.shards.request);
  put(bytes, kShardCountAt, header.shards.count);
  for (const std::uint32_t i : header.shards.done)
    bytes[kShardsAt + i / 8] = static_cast<unsigned char>(bytes[kShardsAt + i / 8] | 1u << i % 8);
  put(bytes, kSumAt, hash64(bytes, kSumAt));
  return result;
}

std::uint64_t header_sum(const HeaderBytes& bytes) {
  return get<std::uint64_t>(bytes.data(), kSumAt);
}

BlockHeaderBytes encode_block_header(const BlockHeader& block) {
  BlockHeaderBytes result{};
  unsigned char* bytes = result.data();
  put(bytes, 0, kBlockMagic);
  put(bytes, 4, block.kind);
  put(bytes, 5, block.layer);
  put(bytes, 6, block.wave);
  put(bytes, 7, block.flags);
  put(bytes, 8, block.count);
  put(bytes, 12, block.sequence);
  put(bytes, 16, static_cast<std::uint32_t>(block.offset / kOffsetUnit));
  put(bytes, 20, block.cumulative);
  put(bytes, 24, block.first_key);
  put(bytes, 32, block.last_key);
  put(bytes, 40, block.previous);
  put(bytes, 48, block.payload_sum);
  put(bytes, 56, hash64(bytes, 56));
  return result;
}

std::uint64_t block_header_sum(const BlockHeaderBytes& bytes) {
  return get<std::uint64_t>(bytes.data(), 56);
}

std::vector<unsigned char> encode_tail(const std::vector<BlockHeader>& blocks,
                                       const std::vector<std::uint64_t>& block_sums,
                                       std::uint64_t end) {
  std::vector<unsigned char> result(blocks.size() * kIndexEntryBytes + kFooterBytes, 0);
  std::uint64_t records = 0;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const BlockHeader& block = blocks[i];
    unsigned char* entry = result.data() + i * kIndexEntryBytes;
    put(entry, 0, block.offset);
    put(entry, 8, block.first_key);
    put(entry, 16, block.last_key);
    put(entry, 24, block.count);
    put(entry, 28, block.kind);
    put(entry, 29, block.layer);
    put(entry, 30, block.wave);
    put(entry, 31, block.flags);
    records += block.count;
  }
  const std::size_t index_bytes = blocks.size() * kIndexEntryBytes;
  unsigned char* footer = result.data() + index_bytes;
  put(footer, 0, kFooterMagic);
  put(footer, 4, static_cast<std::uint32_t>(blocks.size()));
  put(footer, 8, records);
  put(footer, 16, end);                   // Where the index starts.
  put(footer, 24, end + result.size());   // The file's size.
  put(footer, 32, hash64(block_sums.data(), block_sums.size() * sizeof(std::uint64_t)));
  put(footer, 40, hash64(result.data(), index_bytes));
  put(footer, 120, hash64(footer, 120));
  return result;
}

HeaderReading decode_header(const std::vector<unsigned char>& file) {
  HeaderReading result;
  const auto refuse = [&](CacheState state, const std::string& reason) {
    result.state = state;
    result.reason = reason;
    return result;
  };
  const auto [state, reason] = check_magic(file);
  if (state != CacheState::Loaded) return refuse(state, reason);
  if (file.size() < kHeaderBytes) return refuse(CacheState::Corrupt, "the file ends in its header");
  const unsigned char* bytes = file.data();
  // The version and the endian mark come before the sum: another major version may sum other bytes.
  const auto major = get<std::uint16_t>(bytes, kVersionAt);
  const auto endian = get<std::uint32_t>(bytes, kEndianAt);
  if (endian != kEndianMark && endian == 0x04030201)
    return refuse(CacheState::Foreign, "written in big-endian byte order");
  if (major != kMajor)
    return refuse(CacheState::Foreign, "format version " + std::to_string(major) +
                                           "; this brume reads version " + std::to_string(kMajor));
  if (get<std::uint64_t>(bytes, kSumAt) != hash64(bytes, kSumAt))
    return refuse(CacheState::Corrupt, "the header's checksum does not match");

  // From here on the bytes are those some program meant to write.
  if (endian != kEndianMark) return refuse(CacheState::Foreign, "unknown byte order");
  if (get<std::uint32_t>(bytes, kHeaderBytesAt) != kHeaderBytes)
    return refuse(CacheState::Foreign, "its header is not of 4096 bytes");
  if (get<std::uint32_t>(bytes, kRequiredAt) != 0)
    return refuse(CacheState::Foreign, "needs features of a newer brume");
  const auto block_records = get<std::uint32_t>(bytes, kBlockRecordsAt);
  if (block_records == 0 || block_records > CacheWriter::kBlockRecords)
    return refuse(CacheState::Foreign,
                  "blocks of " + std::to_string(block_records) + " records are not readable");
  for (std::size_t k = 0; k < kKinds; ++k)
    result.record_bytes[k] = get<std::uint32_t>(bytes, kKindBytesAt + 4 * k);
  if (result.record_bytes[0] != sizeof(SurfaceRecord))
    return refuse(CacheState::Foreign,
                  "records of " + std::to_string(result.record_bytes[0]) + " bytes, not 128");
  for (const std::uint32_t size : result.record_bytes)
    if (size > 65536 || size % kOffsetUnit != 0)
      return refuse(CacheState::Foreign, "records of " + std::to_string(size) + " bytes");
  // Fields of other kinds may follow ours, or come with a newer minor version.
  if (!has_fields(bytes, fields_of(kNoVolumeRecords)))
    return refuse(CacheState::Foreign, "its records have other fields");

  CacheHeader& header = result.header;
  for (int order = 0; order <= kMaxHarmonicOrder; ++order)
    if (result.record_bytes[1] == volume_record_file_bytes(order) &&
        has_fields(bytes, fields_of(order)))
      header.volume_order = order;
  header.format_minor = get<std::uint16_t>(bytes, kVersionAt + 2);
  header.fingerprint.words = get<std::array<std::uint64_t, 2>>(bytes, kFingerprintAt);
  for (int a = 0; a < 3; ++a)
    header.origin[a] = get<double>(bytes, kOriginAt + 8 * static_cast<std::size_t>(a));
  if (!is_finite(header.origin)) return refuse(CacheState::Corrupt, "the origin is not finite");
  const auto settings_bytes = get<std::uint32_t>(bytes, kSettingsBytesAt);
  const bool has_shards = header.format_minor > 0;
  if (settings_bytes > (has_shards ? CacheHeader::kMaxSettingsBytes : kMaxSettingsBytesOfMinor0))
    return refuse(CacheState::Corrupt, "the settings do not fit the header");
  if (has_shards) {
    ShardSet& shards = header.shards;
    shards.request = get<std::uint64_t>(bytes, kRequestAt);
    shards.count = get<std::uint32_t>(bytes, kShardCountAt);
    for (std::uint32_t i = 0; i < ShardSet::kMaxShards; ++i)
      if (bytes[kShardsAt + i / 8] >> i % 8 & 1) shards.done.push_back(i);
    if (!shards.is_valid()) return refuse(CacheState::Corrupt, "it names shards that cannot be");
  }
  const auto text = [&](std::size_t at, std::size_t size) {
    return std::string(reinterpret_cast<const char*>(bytes + at), size);
  };
  header.settings = text(kSettingsAt, settings_bytes);
  header.creator = text(kCreatorAt, kCreatorBytes);
  header.creator.erase(std::min(header.creator.find('\0'), header.creator.size()));
  if (!is_text(header.settings) || !is_text(header.creator))
    return refuse(CacheState::Corrupt, "the header's text holds control characters");
  return result;
}

std::optional<BlockHeader> decode_block_header(const BlockHeaderBytes& encoded) {
  const unsigned char* bytes = encoded.data();
  if (!std::equal(std::begin(kBlockMagic), std::end(kBlockMagic), bytes) ||
      get<std::uint64_t>(bytes, 56) != hash64(bytes, 56))
    return std::nullopt;
  BlockHeader block;
  block.kind = bytes[4];
  block.layer = bytes[5];
  block.wave = bytes[6];
  block.flags = bytes[7];
  block.count = get<std::uint32_t>(bytes, 8);
  block.sequence = get<std::uint32_t>(bytes, 12);
  block.offset = get<std::uint32_t>(bytes, 16) * kOffsetUnit;
  block.cumulative = get<std::uint32_t>(bytes, 20);
  block.first_key = get<std::uint64_t>(bytes, 24);
  block.last_key = get<std::uint64_t>(bytes, 32);
  block.previous = get<std::uint64_t>(bytes, 40);
  block.payload_sum = get<std::uint64_t>(bytes, 48);
  return block;
}

}  // namespace brume::cache_layout
