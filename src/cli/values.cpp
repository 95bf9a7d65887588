#include "cli/values.h"

#include <charconv>
#include <sstream>

#include "core/error.h"

namespace brume {
namespace {

// The whole text as a number, or nothing. from_chars knows no locale and no leading blanks.
template <typename T>
std::optional<T> whole_number(const std::string& text) {
  T value{};
  const char* begin = text.data() + (text.size() > 1 && text[0] == '+' ? 1 : 0);
  const char* end = text.data() + text.size();
  const auto [stop, status] = std::from_chars(begin, end, value);
  if (status != std::errc() || stop != end) return std::nullopt;
  return value;
}

std::string shown(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string shown_range(const std::string& low, const std::string& high, bool has_high) {
  return has_high ? low + " to " + high : "at least " + low;
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator)
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

std::optional<std::vector<double>> finite_numbers(const std::string& text, std::size_t count) {
  std::vector<double> numbers;
  for (const std::string& part : split(text, ',')) {
    const auto number = whole_number<double>(part);
    if (!number || !std::isfinite(*number)) return std::nullopt;
    numbers.push_back(*number);
  }
  if (numbers.size() != count) return std::nullopt;
  return numbers;
}

}  // namespace

void refuse_value(const std::string& option, const std::string& text, const std::string& expected) {
  throw CLI::ValidationError(option, "'" + printable(text) + "' is not " + expected);
}

double parse_number(const std::string& option, const std::string& text, double min, double max) {
  const auto value = whole_number<double>(text);
  if (!value || !(*value >= min && *value <= max) || !std::isfinite(*value))
    refuse_value(option, text, "a number, " + shown_range(shown(min), shown(max), max < 1e300));
  return *value;
}

std::int64_t parse_integer(const std::string& option, const std::string& text, std::int64_t min,
                           std::int64_t max) {
  const auto value = whole_number<std::int64_t>(text);
  if (!value || *value < min || *value > max)
    refuse_value(option, text,
                 "a whole number, " + shown_range(std::to_string(min), std::to_string(max),
                                                  max < std::numeric_limits<int>::max()));
  return *value;
}

std::uint64_t parse_unsigned(const std::string& option, const std::string& text) {
  const auto value = whole_number<std::uint64_t>(text);
  if (!value) refuse_value(option, text, "a whole number, at least 0");
  return *value;
}

Size2 parse_size(const std::string& option, const std::string& text, int max) {
  const auto parts = split(text, 'x');
  const auto x = whole_number<int>(parts[0]);
  const auto y = parts.size() == 2 ? whole_number<int>(parts[1]) : std::nullopt;
  if (!x || !y || *x < 1 || *y < 1 || *x > max || *y > max)
    refuse_value(option, text,
                 "two whole numbers from 1 to " + std::to_string(max) + ", like 64x32");
  return {*x, *y};
}

Vec3d parse_vector(const std::string& option, const std::string& text) {
  const auto numbers = finite_numbers(text, 3);
  if (!numbers) refuse_value(option, text, "three numbers, like 0,1.5,-2");
  return {(*numbers)[0], (*numbers)[1], (*numbers)[2]};
}

Size2 parse_pixel(const std::string& option, const std::string& text) {
  const auto parts = split(text, ',');
  const auto x = whole_number<int>(parts[0]);
  const auto y = parts.size() == 2 ? whole_number<int>(parts[1]) : std::nullopt;
  if (!x || !y || *x < 0 || *y < 0)
    refuse_value(option, text, "a pixel, like 120,64 (from the top left corner, which is 0,0)");
  return {*x, *y};
}

CropRegion parse_crop(const std::string& option, const std::string& text) {
  const auto n = finite_numbers(text, 4);
  const bool is_pixels = text.find_first_of(".eE") == std::string::npos;
  const bool in_range = n && (*n)[0] >= 0 && (*n)[1] >= 0 && (*n)[0] < (*n)[2] &&
                        (*n)[1] < (*n)[3] && (is_pixels || ((*n)[2] <= 1 && (*n)[3] <= 1));
  if (!in_range)
    refuse_value(option, text,
                 "x0,y0,x1,y1 with x0 < x1 and y0 < y1: pixels, like 0,0,64,32, or fractions, like "
                 "0.25,0.25,0.5,1.0");
  return {(*n)[0], (*n)[1], (*n)[2], (*n)[3], is_pixels};
}

std::uint64_t parse_bytes(const std::string& option, const std::string& text) {
  const std::size_t letters = text.find_first_not_of("0123456789.");
  const auto number = whole_number<double>(text.substr(0, letters));
  std::string unit = letters == std::string::npos ? "" : text.substr(letters);
  if (unit.size() > 1 && unit.back() == 'B') unit.pop_back();
  if (unit.size() == 2 && unit.back() == 'i') unit.pop_back();
  const std::string units = "KMGT";
  const std::size_t power = unit.size() == 1 ? units.find(unit) : std::string::npos;
  if (!number || (!unit.empty() && power == std::string::npos) || !(*number > 0))
    refuse_value(option, text, "a size, like 512M or 4G");
  const double bytes = *number * (unit.empty() ? 1.0 : std::exp2(10.0 * double(power + 1)));
  if (!(bytes >= 1 && bytes < 9e18)) refuse_value(option, text, "a size that fits in memory");
  return static_cast<std::uint64_t>(bytes);
}

double parse_length(const std::string& option, const std::string& text) {
  static const std::pair<const char*, double> kUnits[] = {
      {"mm", 1e-3}, {"cm", 1e-2}, {"m", 1.0}, {"km", 1e3}};
  const std::size_t letters = text.find_first_not_of("0123456789.eE+-");
  const auto number = whole_number<double>(text.substr(0, letters));
  const std::string unit = letters == std::string::npos ? "" : text.substr(letters);
  for (const auto& [name, metres] : kUnits)
    if (number && unit == name && *number > 0 && std::isfinite(*number)) return *number * metres;
  refuse_value(option, text, "a length with its unit, like 5mm, 2.5cm, 1m or 3km");
}

std::vector<std::string> parse_list(const std::string& text) {
  std::vector<std::string> names;
  for (const std::string& part : split(text, ','))
    if (!part.empty()) names.push_back(part);
  return names;
}

CLI::Option* add_number(CLI::App& app, const std::string& names, std::optional<double>& target,
                        double min, double max, const std::string& description) {
  return add_parsed(
      app, names, "X", target,
      [min, max](const std::string& option, const std::string& text) {
        return parse_number(option, text, min, max);
      },
      description);
}

CLI::Option* add_integer(CLI::App& app, const std::string& names, std::optional<int>& target,
                         int min, int max, const std::string& description) {
  return add_parsed(
      app, names, "N", target,
      [min, max](const std::string& option, const std::string& text) {
        return static_cast<int>(parse_integer(option, text, min, max));
      },
      description);
}

CLI::Option* add_path(CLI::App& app, const std::string& names, std::filesystem::path& target,
                      const std::string& type_name, const std::string& description) {
  return add_parsed(
      app, names, type_name, target,
      [](const std::string& option, const std::string& text) {
        if (text.empty()) refuse_value(option, text, "a file name");
        return std::filesystem::path(text);
      },
      description);
}

}  // namespace brume
