#include "exchange/text_records.h"

#include <charconv>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "cache/cache_copy.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/staged_file.h"
#include "exchange/record_columns.h"
#include "exchange/text_header.h"

namespace brume {
namespace {

// Reads numbers as floats straight from their digits: through double they would be rounded twice.
using FloatJson = nlohmann::basic_json<std::map, std::vector, std::string, bool, std::int64_t,
                                       std::uint64_t, float>;

constexpr std::string_view kHeaderBegin = "{\"brume_cache\":";
constexpr const char* kCsvKeys[] = {"kind", "key", "layer", "wave", "flags"};
constexpr int kFlagsShift = 16;  // Below it are layer and wave.

float get(const SurfaceRecord& record, const RecordColumn& column, std::size_t part) {
  float value;
  std::memcpy(&value, reinterpret_cast<const char*>(&record) + column.offset + part * sizeof value,
              sizeof value);
  return value;
}
void set(SurfaceRecord& record, const RecordColumn& column, std::size_t part, float value) {
  std::memcpy(reinterpret_cast<char*>(&record) + column.offset + part * sizeof value, &value,
              sizeof value);
}

void append(std::string& text, float value) {
  // JSON readers take "-0" for an integer, which has no sign.
  if (value == 0 && std::signbit(value)) {
    text += "-0.0";
    return;
  }
  char digits[32];
  text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

void append_hex(std::string& text, std::uint64_t key) {
  char digits[20];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(key));
  text += digits;
}

void append_csv(std::string& text, const SurfaceRecord& record) {
  text += kSurfaceKind;
  text += ',';
  append_hex(text, record.key);
  text += ',' + std::to_string(record.layer()) + ',' + std::to_string(record.wave()) + ',' +
          std::to_string(record.flags >> kFlagsShift);
  for (const RecordColumn& column : surface_columns())
    for (std::size_t i = 0; i < column.size(); ++i) {
      text += ',';
      append(text, get(record, column, i));
    }
  text += '\n';
}

void append_json(std::string& text, const SurfaceRecord& record) {
  text += "{\"kind\":\"";
  text += kSurfaceKind;
  text += "\",\"key\":\"";
  append_hex(text, record.key);
  text += "\",\"layer\":" + std::to_string(record.layer()) +
          ",\"wave\":" + std::to_string(record.wave()) +
          ",\"flags\":" + std::to_string(record.flags >> kFlagsShift);
  for (const RecordColumn& column : surface_columns()) {
    text += ",\"";
    text += column.name;
    text += column.size() > 1 ? "\":[" : "\":";
    for (std::size_t i = 0; i < column.size(); ++i) {
      if (i > 0) text += ',';
      append(text, get(record, column, i));
    }
    if (column.size() > 1) text += ']';
  }
  text += "}\n";
}

std::string csv_names() {
  std::string names;
  for (const char* key : kCsvKeys) names += (names.empty() ? "" : ",") + std::string(key);
  for (const RecordColumn& column : surface_columns())
    for (std::size_t i = 0; i < column.size(); ++i) names += ',' + column.full_name(i);
  return names;
}

// Lines of one file, with the place for messages.
class Lines {
 public:
  explicit Lines(const std::filesystem::path& file) : file_(file), stream_(file, std::ios::binary) {
    if (!stream_)
      throw Error(ErrorKind::InvalidInput, printable(file.string()) + ": cannot be opened");
  }
  // False at the end; empty lines are passed over.
  bool next(std::string& line) {
    while (std::getline(stream_, line)) {
      ++number_;
      if (!line.empty() && line.back() == '\r') line.pop_back();
      if (!line.empty()) return true;
    }
    return false;
  }
  std::string place() const {
    return printable(file_.string()) + ": line " + std::to_string(number_);
  }
  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(ErrorKind::InvalidInput, place() + ": " + what);
  }

 private:
  std::filesystem::path file_;
  std::ifstream stream_;
  std::size_t number_ = 0;
};

template <typename T>
T parse(const Lines& lines, const std::string& name, std::string_view text, T most, int base = 10) {
  T value{};
  const auto [stopped, problem] = [&] {
    if constexpr (std::is_floating_point_v<T>)
      return std::from_chars(text.data(), text.data() + text.size(), value);
    else
      return std::from_chars(text.data(), text.data() + text.size(), value, base);
  }();
  if (problem != std::errc() || stopped != text.data() + text.size() || !(value <= most))
    lines.refuse("column " + name + ": '" + printable(std::string(text), 40) +
                 "' is no value of its kind: write it as `brume convert` does");
  return value;
}

// Fields of a line; quotes that spreadsheets put around them are taken off.
std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  for (;;) {
    const std::size_t comma = line.find(',');
    std::string_view field = line.substr(0, comma);
    if (field.size() >= 2 && field.front() == '"' && field.back() == '"')
      field = field.substr(1, field.size() - 2);
    fields.push_back(field);
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

class CsvReader {
 public:
  CsvReader(const Lines& lines, const std::string& names) {
    std::vector<std::string> expected(std::begin(kCsvKeys), std::end(kCsvKeys));
    for (const RecordColumn& column : surface_columns())
      for (std::size_t i = 0; i < column.size(); ++i) expected.push_back(column.full_name(i));
    const auto given = fields_of(names);
    for (const std::string& name : expected) {
      const auto found = std::find(given.begin(), given.end(), name);
      if (found == given.end()) lines.refuse("column " + name + " is missing");
      at_.push_back(static_cast<std::size_t>(found - given.begin()));
      names_.push_back(name);
    }
    for (const std::string_view name : given)
      if (std::find(expected.begin(), expected.end(), name) == expected.end() ||
          std::count(given.begin(), given.end(), name) > 1)
        lines.refuse("column '" + printable(std::string(name), 40) + "' is unknown or there twice");
    count_ = given.size();
  }

  SurfaceRecord read(const Lines& lines, const std::string& line) const {
    const auto fields = fields_of(line);
    if (fields.size() != count_)
      lines.refuse("has " + std::to_string(fields.size()) + " columns, not " +
                   std::to_string(count_));
    const auto field = [&](std::size_t i) { return fields[at_[i]]; };
    if (field(0) != kSurfaceKind)
      lines.refuse("records of kind '" + printable(std::string(field(0)), 40) + "' are unknown");
    SurfaceRecord record{};
    record.key = parse<std::uint64_t>(lines, names_[1], field(1), ~std::uint64_t(0), 16);
    record.flags = record_flags(parse(lines, names_[2], field(2), 255),
                                parse(lines, names_[3], field(3), 255)) |
                   parse(lines, names_[4], field(4), 0xffffu) << kFlagsShift;
    std::size_t i = std::size(kCsvKeys);
    for (const RecordColumn& column : surface_columns())
      for (std::size_t part = 0; part < column.size(); ++part, ++i)
        set(record, column, part,
            parse(lines, names_[i], field(i), std::numeric_limits<float>::max()));
    return record;
  }

 private:
  std::vector<std::size_t> at_;  // Where each expected column stands.
  std::vector<std::string> names_;
  std::size_t count_ = 0;
};

SurfaceRecord read_json(const Lines& lines, const std::string& line) {
  const FloatJson object = FloatJson::parse(line, nullptr, false);
  if (!object.is_object()) lines.refuse("not one JSON object");
  const auto member = [&](const char* key) -> const FloatJson& {
    const auto found = object.find(key);
    if (found == object.end()) lines.refuse(std::string(key) + " is missing");
    return *found;
  };
  const auto integer = [&](const char* key, std::uint64_t most) {
    const FloatJson& value = member(key);
    if (!value.is_number_unsigned() || value.get<std::uint64_t>() > most)
      lines.refuse(std::string(key) + " is not 0 to " + std::to_string(most));
    return static_cast<std::uint32_t>(value.get<std::uint64_t>());
  };
  const FloatJson& kind = member("kind");
  if (!kind.is_string() || kind.get<std::string>() != kSurfaceKind)
    lines.refuse("records of this kind are unknown");
  SurfaceRecord record{};
  const FloatJson& key = member("key");
  if (!key.is_string()) lines.refuse("key is no text");
  record.key =
      parse<std::uint64_t>(lines, "key", key.get_ref<const std::string&>(), ~std::uint64_t(0), 16);
  record.flags = record_flags(static_cast<int>(integer("layer", 255)),
                              static_cast<int>(integer("wave", 255))) |
                 integer("flags", 0xffff) << kFlagsShift;
  for (const RecordColumn& column : surface_columns()) {
    const FloatJson& values = member(column.name);
    const bool is_list = column.size() > 1;
    if (is_list ? !values.is_array() || values.size() != column.size() : !values.is_number())
      lines.refuse(std::string(column.name) + " is not " + std::to_string(column.size()) +
                   " numbers");
    for (std::size_t i = 0; i < column.size(); ++i) {
      const FloatJson& value = is_list ? values[i] : values;
      if (!value.is_number()) lines.refuse(std::string(column.name) + " holds no number");
      set(record, column, i, value.get<float>());
    }
  }
  return record;
}

}  // namespace

std::optional<TextFormat> text_format_of(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) return std::nullopt;
  std::string begin(kHeaderBegin.size() + 2, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  if (begin.rfind(kHeaderBegin, 0) == 0) return TextFormat::JsonLines;
  if (begin == "# " + std::string(kHeaderBegin)) return TextFormat::Csv;
  return std::nullopt;
}

void write_text_records(const std::filesystem::path& file, TextFormat format,
                        const CacheContents& contents) {
  constexpr std::size_t kFlushBytes = std::size_t(1) << 20;
  const DenormalsKept every_float;
  StagedFile out(file);
  const bool is_csv = format == TextFormat::Csv;
  std::string text = (is_csv ? "# " : "") + text_header_line(contents) + '\n';
  if (is_csv) text += csv_names() + '\n';
  for (const SurfaceRecord& record : contents.records) {
    is_csv ? append_csv(text, record) : append_json(text, record);
    if (text.size() < kFlushBytes) continue;
    out.write(text.data(), text.size());
    text.clear();
  }
  out.write(text.data(), text.size());
  out.commit();
}

CacheContents read_text_records(const std::filesystem::path& file) {
  const DenormalsKept every_float;
  const auto format = text_format_of(file);
  if (!format)
    throw Error(ErrorKind::InvalidInput,
                printable(file.string()) +
                    ": no cache as text: its first line is not what `brume convert` writes");
  Lines lines(file);
  std::string line;
  lines.next(line);
  const bool is_csv = *format == TextFormat::Csv;
  TextHeader header = parse_text_header(is_csv ? line.substr(2) : line, lines.place());
  std::optional<CsvReader> csv;
  if (is_csv) {
    if (!lines.next(line)) lines.refuse("the names of the columns are missing");
    csv.emplace(lines, line);
  }
  CacheContents contents;
  while (lines.next(line)) {
    contents.records.push_back(csv ? csv->read(lines, line) : read_json(lines, line));
    if (const char* fault = record_fault(contents.records.back())) lines.refuse(fault);
  }
  const std::size_t count = contents.records.size();
  if (header.records && *header.records != count)
    throw Error(ErrorKind::InvalidInput,
                printable(file.string()) + ": holds " + std::to_string(count) +
                    " records, its first line tells of " + std::to_string(*header.records) +
                    ": cut off, or edited: then set \"records\" there");
  contents.header = std::move(header.header);
  contents.notes = std::move(header.notes);
  contents.batch_ends = header.batch_ends.empty() ? standard_batch_ends(contents.records)
                                                  : std::move(header.batch_ends);
  if (header.has_lookup_order)
    contents.curve_order = lookup_order(contents.records, contents.header.origin);
  return contents;
}

}  // namespace brume
