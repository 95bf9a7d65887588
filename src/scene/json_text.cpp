#include "scene/json_text.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "core/error.h"

namespace brume {
namespace {

using nlohmann::json;

// Builds the document from the parser's events, so that a fault is seen where it stands and depth
// is bounded before memory is spent on it.
class Builder : public nlohmann::json_sax<json> {
 public:
  Builder(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  json take() { return std::move(root_); }

  bool null() override { return add(nullptr); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(number_integer_t value) override { return add(value); }
  bool number_unsigned(number_unsigned_t value) override { return add(value); }
  bool number_float(number_float_t value, const string_t&) override { return add(value); }
  bool string(string_t& value) override { return add(std::move(value)); }
  bool binary(binary_t&) override { return false; }

  bool start_object(std::size_t) override { return open(json::object()); }
  bool start_array(std::size_t) override { return open(json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    Level& level = levels_.back();
    if (!level.seen.insert(name).second)
      throw Error(ErrorKind::InvalidInput, file_ + ": " +
                                               printable(child_pointer(pointer(), name)) +
                                               ": this key stands here twice: keep one of them");
    level.key = name;
    return true;
  }

  bool parse_error(std::size_t position, const std::string&,
                   const nlohmann::detail::exception& failure) override {
    std::string reason = failure.what();
    if (const auto bracket = reason.find("] "); bracket != std::string::npos)
      reason.erase(0, bracket + 2);
    // The reason repeats the place in its own words.
    if (reason.rfind("parse error at line", 0) == 0)
      if (const auto colon = reason.find(": "); colon != std::string::npos)
        reason.erase(0, colon + 2);
    if (text_.find_first_not_of(" \t\r\n") == std::string_view::npos)
      throw Error(ErrorKind::InvalidInput,
                  file_ + ": the file is empty: a scene is a JSON object, see brume scene schema");
    const std::string_view before = text_.substr(0, std::min(position, text_.size()));
    const auto line = 1 + std::count(before.begin(), before.end(), '\n');
    const auto line_begin = before.rfind('\n');
    const std::size_t column =
        line_begin == std::string_view::npos ? before.size() : before.size() - line_begin - 1;
    std::string place = "line " + std::to_string(line) + ", column " + std::to_string(column);
    if (!levels_.empty()) place += ", in " + (levels_.size() == 1 ? "/" : printable(pointer()));
    throw Error(ErrorKind::InvalidInput,
                file_ + ": " + place + ": " + printable(reason, 300) + ": correct the JSON there");
  }

 private:
  struct Level {
    json* value;
    std::string key;
    std::set<std::string> seen;
  };

  std::string pointer() const {
    std::string p;
    // The last level's own key is the child that is being read.
    for (std::size_t i = 0; i + 1 < levels_.size(); ++i) p = child(p, levels_[i]);
    return p;
  }
  static std::string child(const std::string& p, const Level& level) {
    return level.value->is_array() ? child_pointer(p, level.value->size() - 1)
                                   : child_pointer(p, level.key);
  }

  json* place(json value) {
    if (levels_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    Level& level = levels_.back();
    if (level.value->is_array()) {
      level.value->push_back(std::move(value));
      return &level.value->back();
    }
    return &((*level.value)[level.key] = std::move(value));
  }
  bool add(json value) {
    place(std::move(value));
    return true;
  }
  bool open(json container) {
    if (levels_.size() >= kMaxJsonDepth)
      throw Error(ErrorKind::InvalidInput,
                  file_ + ": " + printable(pointer(), 60) + ": nested deeper than " +
                      std::to_string(kMaxJsonDepth) + " levels: a scene file needs 6");
    json* value = place(std::move(container));
    levels_.push_back({value, {}, {}});
    return true;
  }
  bool close() {
    levels_.pop_back();
    return true;
  }

  std::string_view text_;
  const std::string& file_;
  json root_;
  std::vector<Level> levels_;
};

}  // namespace

json parse_json_text(std::string_view text, const std::string& file) {
  Builder builder(text, file);
  json::sax_parse(text.begin(), text.end(), &builder, json::input_format_t::json, true, true);
  return builder.take();
}

std::string child_pointer(const std::string& pointer, std::string_view key) {
  std::string out = pointer + "/";
  for (const char c : key) {
    if (c == '~')
      out += "~0";
    else if (c == '/')
      out += "~1";
    else
      out += c;
  }
  return out;
}

std::string child_pointer(const std::string& pointer, std::size_t index) {
  return pointer + "/" + std::to_string(index);
}

std::string shown(const json& value) {
  if (value.is_object()) return "an object";
  if (value.is_array()) return "a list of " + std::to_string(value.size());
  return printable(value.dump(-1, ' ', false, json::error_handler_t::replace), 60);
}

}  // namespace brume
