// Values of options as text: parsed strictly, refused with what was expected.
//
// Each throws CLI::ValidationError naming the option, so that a value from the command line and one
// from the environment are refused alike.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/math.h"

namespace brume {

struct Size2 {
  int x = 0, y = 0;
};

// A rectangle [x0, x1) x [y0, y1) of an image, (0,0) the top left corner.
struct CropRegion {
  double x0 = 0, y0 = 0, x1 = 1, y1 = 1;
  bool is_pixels = false;  // Else fractions of width and height.
};

[[noreturn]] void refuse_value(const std::string& option, const std::string& text,
                               const std::string& expected);

// Finite and inside [min, max].
double parse_number(const std::string& option, const std::string& text, double min, double max);
std::int64_t parse_integer(const std::string& option, const std::string& text, std::int64_t min,
                           std::int64_t max);
std::uint64_t parse_unsigned(const std::string& option, const std::string& text);
// "1920x1080": both at least 1, at most `max`.
Size2 parse_size(const std::string& option, const std::string& text, int max);
Vec3d parse_vector(const std::string& option, const std::string& text);
// "x,y".
Size2 parse_pixel(const std::string& option, const std::string& text);
// "x0,y0,x1,y1": pixels where all four are whole numbers, fractions where one has a decimal point.
CropRegion parse_crop(const std::string& option, const std::string& text);
// "512M", "4G", "1.5GiB", "1000000": K, M, G, T are powers of 1024.
std::uint64_t parse_bytes(const std::string& option, const std::string& text);
// "5mm", "2.5cm", "1m", "3km", above 0: metres.
double parse_length(const std::string& option, const std::string& text);
std::vector<std::string> parse_list(const std::string& text);

template <typename T>
T parse_choice(const std::string& option, const std::string& text,
               const std::vector<std::pair<std::string, T>>& choices) {
  std::string names;
  for (const auto& [name, value] : choices) {
    if (name == text) return value;
    names += (names.empty() ? "" : ", ") + name;
  }
  refuse_value(option, text, "one of " + names);
}

// Adds an option whose text goes through `parse(option, text)` into `target`; given twice, the last
// wins.
template <typename Target, typename Parse>
CLI::Option* add_parsed(CLI::App& app, const std::string& names, const std::string& type_name,
                        Target& target, Parse parse, const std::string& description) {
  const std::string option =
      names.substr(names.rfind(',') == std::string::npos ? 0 : names.rfind(',') + 1);
  return app
      .add_option_function<std::string>(
          names,
          [&target, parse, option](const std::string& text) { target = parse(option, text); },
          description)
      ->type_name(type_name)
      ->take_last();
}

template <typename T>
CLI::Option* add_choice(CLI::App& app, const std::string& names,
                        const std::vector<std::pair<std::string, T>>& choices,
                        std::optional<T>& target, const std::string& description) {
  std::string type;
  for (const auto& choice : choices) type += (type.empty() ? "" : "|") + choice.first;
  return add_parsed(
      app, names, type, target,
      [choices](const std::string& option, const std::string& text) {
        return parse_choice(option, text, choices);
      },
      description);
}

CLI::Option* add_number(CLI::App& app, const std::string& names, std::optional<double>& target,
                        double min, double max, const std::string& description);
CLI::Option* add_integer(CLI::App& app, const std::string& names, std::optional<int>& target,
                         int min, int max, const std::string& description);
CLI::Option* add_path(CLI::App& app, const std::string& names, std::filesystem::path& target,
                      const std::string& type_name, const std::string& description);

}  // namespace brume
