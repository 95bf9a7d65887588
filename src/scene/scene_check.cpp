#include "scene/scene_check.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "core/error.h"
#include "scene/json_text.h"

namespace brume {
namespace {

using nlohmann::json;

std::string in_quotes(std::string_view text) { return "\"" + printable(std::string(text)) + "\""; }

template <typename Texts>
std::string list_text(const Texts& texts) {
  std::string out;
  for (const auto& t : texts) out += (out.empty() ? "" : ", ") + std::string(t);
  return out;
}

std::string lower(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
  return text;
}

// Edits that turn a into b, a swap of neighbours counting as one.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i)
    for (std::size_t j = 1; j <= b.size(); ++j) {
      d[i][j] =
          std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

const char* json_kind(const json& value) {
  if (value.is_boolean()) return "true or false";
  if (value.is_number_integer()) return "an integer";
  if (value.is_number()) return "a number";
  if (value.is_string()) return "a string";
  if (value.is_array()) return "a list";
  if (value.is_object()) return "an object";
  return "null";
}

class Checker {
 public:
  explicit Checker(const SceneDocument& document) : document_(document) {}

  void object(const json& value, const ObjectSchema& schema, const std::string& pointer) const {
    if (!value.is_object()) wrong_type(value, pointer, "an object, a " + std::string(schema.name));
    const std::string kind = discriminator(value, schema, pointer);
    for (const auto& [name, member] : value.items()) {
      const KeySchema* key = schema.find(name, kind);
      const std::string at = child_pointer(pointer, name);
      if (!key) document_.fail(at, "unknown key", name_hint(name, known_keys(schema, kind)));
      if (!key->belongs_to(kind))
        document_.fail(at,
                       "a " + std::string(schema.name) + " of " +
                           std::string(schema.discriminator) + " " + in_quotes(kind) +
                           " has no such key",
                       "remove it; its keys are " + list_text(known_keys(schema, kind)));
      check(member, *key, at);
    }
    for (const KeySchema& key : schema.keys)
      if (key.required && key.belongs_to(kind) && !value.contains(std::string(key.name)))
        document_.fail(pointer.empty() ? "/" : pointer,
                       "the key " + in_quotes(key.name) + " is missing",
                       "add " + in_quotes(key.name) + ": " + std::string(key.doc));
  }

 private:
  static std::vector<std::string> known_keys(const ObjectSchema& schema, std::string_view kind) {
    std::vector<std::string> names;
    for (const KeySchema& key : schema.keys)
      if (key.belongs_to(kind)) names.emplace_back(key.name);
    return names;
  }

  // Checked before all else: it decides what the other keys mean.
  std::string discriminator(const json& value, const ObjectSchema& schema,
                            const std::string& pointer) const {
    if (schema.discriminator.empty()) return "";
    const KeySchema& key = *schema.find(schema.discriminator);
    const auto it = value.find(std::string(key.name));
    if (it != value.end()) {
      check(*it, key, child_pointer(pointer, key.name));
      return it->get<std::string>();
    }
    if (key.required)
      document_.fail(pointer, "the key " + in_quotes(key.name) + " is missing",
                     "add it, one of " + list_text(key.choices));
    return json::parse(key.fallback).get<std::string>();
  }

  [[noreturn]] void wrong_type(const json& value, const std::string& pointer,
                               const std::string& expected) const {
    document_.fail(
        pointer.empty() ? "/" : pointer,
        "found " + (value.is_structured() ? shown(value) : json_kind(value) + (" " + shown(value))),
        "expected " + expected);
  }

  void number(const json& value, const NumberRange& range, const std::string& pointer) const {
    if (!value.is_number()) wrong_type(value, pointer, "a number");
    const double x = value.get<double>();
    if (!std::isfinite(x) || !range.contains(x))
      document_.fail(pointer, shown(value) + " is outside " + range.text(),
                     "give a number in that range");
  }

  void integer(const json& value, const NumberRange& range, const std::string& pointer,
               const char* expected = "an integer") const {
    // 4.0 is an integer to JSON Schema, and so to us.
    if (!value.is_number() || std::floor(value.get<double>()) != value.get<double>())
      wrong_type(value, pointer, expected);
    if (!range.contains(value.get<double>()))
      document_.fail(pointer, shown(value) + " is outside " + range.text(),
                     range.min == range.max ? "this brume reads " + shown(range.min)
                                            : "give an integer in that range");
  }

  void string(const json& value, const std::string& pointer, const char* expected) const {
    if (!value.is_string()) wrong_type(value, pointer, expected);
  }

  void choice(const json& value, const KeySchema& key, const std::string& pointer) const {
    string(value, pointer, ("one of " + list_text(key.choices)).c_str());
    const std::string text = value.get<std::string>();
    if (std::find(key.choices.begin(), key.choices.end(), text) == key.choices.end())
      document_.fail(pointer, shown(value) + " is not known",
                     name_hint(text, {key.choices.begin(), key.choices.end()}));
  }

  void list(const json& value, const std::string& pointer, std::size_t count,
            const std::string& expected) const {
    if (!value.is_array() || value.size() != count) wrong_type(value, pointer, expected);
  }

  void numbers(const json& value, const NumberRange& range, std::size_t count,
               const std::string& pointer) const {
    list(value, pointer, count, std::to_string(count) + " numbers");
    for (std::size_t i = 0; i < count; ++i) number(value[i], range, child_pointer(pointer, i));
  }

  void box(const json& value, const NumberRange& range, const std::string& pointer) const {
    list(value, pointer, 2, "[[min x, y, z], [max x, y, z]]");
    for (std::size_t i = 0; i < 2; ++i) numbers(value[i], range, 3, child_pointer(pointer, i));
    for (std::size_t a = 0; a < 3; ++a)
      if (!(value[0][a].get<double>() < value[1][a].get<double>()))
        document_.fail(child_pointer(child_pointer(pointer, 1), a),
                       shown(value[1][a]) + " is not above the minimum " + shown(value[0][a]),
                       "give each minimum below its maximum");
  }

  void transform(const json& value, const std::string& pointer) const {
    if (!value.is_array() || (!value.empty() && value.size() != 16))
      wrong_type(value, pointer, "16 numbers, row-major, or an empty list");
    if (value.empty()) return;
    numbers(value, {}, 16, pointer);
    for (std::size_t i = 12; i < 16; ++i)
      if (value[i].get<double>() != (i == 15 ? 1 : 0))
        document_.fail(child_pointer(pointer, i),
                       "the last row is not 0, 0, 0, 1, so this is no affine transform",
                       "write it row by row, the translation at 3, 7 and 11");
    Affine3d m;
    for (std::size_t i = 0; i < 12; ++i) m.m[i / 4][i % 4] = value[i].get<double>();
    // Relative to its own size: a volume scaled by 1e-30 on one axis against the others is flat.
    double size = 1;
    for (int c = 0; c < 3; ++c) size *= Vec3d(m.m[0][c], m.m[1][c], m.m[2][c]).length();
    if (!m.inverse() || !(std::abs(m.determinant()) > 1e-12 * size))
      document_.fail(pointer, "the transform is singular", "give one that keeps three dimensions");
  }

  void check(const json& value, const KeySchema& key, const std::string& pointer) const {
    switch (key.type) {
      case KeyType::Number:
        return number(value, key.range, pointer);
      case KeyType::Integer:
        return integer(value, key.range, pointer);
      case KeyType::AutoOrInteger:
        if (value == "auto") return;
        return integer(value, key.range, pointer, "\"auto\" or an integer");
      case KeyType::Boolean:
        if (!value.is_boolean()) wrong_type(value, pointer, "true or false");
        return;
      case KeyType::Text:
        return string(value, pointer, "a name");
      case KeyType::Path:
        return string(value, pointer, "a path");
      case KeyType::Choice:
        return choice(value, key, pointer);
      case KeyType::Numbers:
        return numbers(value, key.range, std::size_t(key.count), pointer);
      case KeyType::Integers:
        list(value, pointer, std::size_t(key.count), std::to_string(key.count) + " integers");
        for (std::size_t i = 0; i < value.size(); ++i)
          integer(value[i], key.range, child_pointer(pointer, i));
        return;
      case KeyType::Box:
        return box(value, key.range, pointer);
      case KeyType::Transform:
        return transform(value, pointer);
      case KeyType::Paths:
      case KeyType::Choices: {
        if (!value.is_array()) wrong_type(value, pointer, "a list of strings");
        std::set<std::string> seen;
        for (std::size_t i = 0; i < value.size(); ++i) {
          const std::string at = child_pointer(pointer, i);
          if (key.type == KeyType::Choices)
            choice(value[i], key, at);
          else
            string(value[i], at, "a path");
          if (!seen.insert(value[i].get<std::string>()).second)
            document_.fail(at, shown(value[i]) + " stands in the list twice", "remove one");
        }
        return;
      }
      case KeyType::Object:
        return object(value, *key.object, pointer);
      case KeyType::ObjectList:
        if (!value.is_array())
          wrong_type(value, pointer, "a list of " + std::string(key.object->name) + " objects");
        for (std::size_t i = 0; i < value.size(); ++i)
          object(value[i], *key.object, child_pointer(pointer, i));
        return;
      case KeyType::ObjectMap:
      case KeyType::TextMap:
        if (!value.is_object()) wrong_type(value, pointer, "an object with a key for each name");
        for (const auto& [name, member] : value.items()) {
          const std::string at = child_pointer(pointer, name);
          if (name.empty()) document_.fail(at, "the name is empty", "give it a name");
          if (key.type == KeyType::ObjectMap)
            object(member, *key.object, at);
          else
            string(member, at, "a name");
        }
        return;
    }
  }

  const SceneDocument& document_;
};

// Where a JSON pointer leads, made on the way where it is not there yet.
json& place_at(const SceneDocument& document, json& root, const std::string& pointer,
               const std::string& what) {
  json* at = &root;
  std::string walked;
  std::size_t begin = 1;
  while (begin <= pointer.size()) {
    const std::size_t end = std::min(pointer.find('/', begin), pointer.size());
    std::string token;
    for (std::size_t i = begin; i < end; ++i) {
      const bool escape = pointer[i] == '~' && i + 1 < end;
      token += !escape ? pointer[i] : pointer[++i] == '0' ? '~' : '/';
    }
    const bool is_number =
        !token.empty() && token.size() < 10 &&
        std::all_of(token.begin(), token.end(), [](char c) { return c >= '0' && c <= '9'; });
    if (at->is_null()) *at = token == "0" || token == "-" ? json::array() : json::object();
    if (at->is_array()) {
      std::size_t index = at->size();
      if (is_number) std::from_chars(token.data(), token.data() + token.size(), index);
      if ((!is_number && token != "-") || index > at->size())
        throw Error(ErrorKind::InvalidInput,
                    document.file() + ": " + printable(walked + "/" + token) + ": " + what +
                        ": the list has " + std::to_string(at->size()) +
                        " entries: give an index from 0 to " + std::to_string(at->size()));
      if (index == at->size()) at->push_back(nullptr);
      at = &(*at)[index];
    } else if (at->is_object()) {
      at = &(*at)[token];
    } else {
      throw Error(ErrorKind::InvalidInput, document.file() + ": " + printable(walked) + ": " +
                                               what + ": this is " + json_kind(*at) +
                                               ", not an object or a list: shorten the pointer");
    }
    walked = child_pointer(walked, token);
    begin = end + 1;
  }
  return *at;
}

}  // namespace

void SceneDocument::apply_override(json& root, const std::string& text) {
  const std::size_t equals = text.find('=');
  const std::string shown_text = "-D " + printable(text);
  if (equals == std::string::npos || text[0] != '/' || equals < 2)
    throw Error(ErrorKind::Usage, shown_text + ": not an override: write -D /json/pointer=value");
  const std::string pointer = text.substr(0, equals), value_text = text.substr(equals + 1);
  json value;
  try {
    value = parse_json_text(value_text, shown_text);
  } catch (const Error&) {
    value = value_text;  // Not JSON: a string without its quotes.
  }
  place_at(*this, root, pointer, shown_text) = std::move(value);
  overrides_.push_back({pointer, shown_text});
}

void SceneDocument::fail(const std::string& pointer, const std::string& what,
                         const std::string& what_to_do) const {
  std::string cause;
  for (const Override& o : overrides_) {
    if ((pointer + "/").starts_with(o.pointer + "/"))
      cause = " (set by " + o.text + ")";
    else if ((o.pointer + "/").starts_with(pointer + "/"))
      cause = " (touched by " + o.text + ")";
  }
  throw Error(ErrorKind::InvalidInput,
              file_ + ": " + printable(pointer) + ": " + what + cause + ": " + what_to_do);
}

void check_scene_document(const SceneDocument& document, const json& root) {
  Checker(document).object(root, scene_object(), "");
}

std::string name_hint(const std::string& name, const std::vector<std::string>& known) {
  if (known.empty()) return "there are none here";
  const std::string* nearest = nullptr;
  std::size_t best = 0;
  if (name.size() <= 64)
    for (const std::string& k : known) {
      // A name that breaks off, or goes on, is as near as one mistake.
      const bool is_start = name.size() >= 3 && (k.starts_with(name) || name.starts_with(k));
      const std::size_t d = is_start ? 1 : edit_distance(lower(name), lower(k));
      if (d <= std::max<std::size_t>(1, std::max(name.size(), k.size()) / 3) &&
          (!nearest || d < best)) {
        nearest = &k;
        best = d;
      }
    }
  if (nearest) return "did you mean " + in_quotes(*nearest) + "?";
  return "known are " + printable(list_text(known), 400);
}

std::string ObjectView::pointer(std::string_view key) const { return child_pointer(pointer_, key); }

const KeySchema& ObjectView::key_schema(std::string_view key) const {
  const KeySchema* found = schema_->find(key);
  if (!found)
    throw Error(ErrorKind::Internal, "the table of scene keys has no " + std::string(key) + " in " +
                                         std::string(schema_->name));
  return *found;
}

bool ObjectView::has(std::string_view key) const {
  return value_->contains(std::string(key_schema(key).name));
}

json ObjectView::value(std::string_view key) const {
  const KeySchema& schema = key_schema(key);
  const auto it = value_->find(std::string(key));
  return it != value_->end() ? *it : json::parse(schema.fallback);
}

double ObjectView::number(std::string_view key) const { return value(key).get<double>(); }
std::int64_t ObjectView::integer(std::string_view key) const {
  return static_cast<std::int64_t>(value(key).get<double>());
}
bool ObjectView::is_auto(std::string_view key) const { return value(key) == "auto"; }
bool ObjectView::boolean(std::string_view key) const { return value(key).get<bool>(); }
std::string ObjectView::text(std::string_view key) const { return value(key).get<std::string>(); }
std::vector<double> ObjectView::numbers(std::string_view key) const {
  return value(key).get<std::vector<double>>();
}
std::vector<std::string> ObjectView::texts(std::string_view key) const {
  return value(key).get<std::vector<std::string>>();
}

std::vector<std::pair<std::string, std::string>> ObjectView::text_map(std::string_view key) const {
  std::vector<std::pair<std::string, std::string>> out;
  if (has(key))
    for (const auto& [name, member] : value_->at(std::string(key)).items())
      out.emplace_back(name, member.get<std::string>());
  return out;
}

Vec3d ObjectView::vector(std::string_view key) const {
  const auto v = numbers(key);
  return {v[0], v[1], v[2]};
}

Rgb ObjectView::color(std::string_view key) const {
  const auto v = numbers(key);
  return {float(v[0]), float(v[1]), float(v[2])};
}

Box3d ObjectView::box(std::string_view key) const {
  const auto v = value(key).get<std::vector<std::vector<double>>>();
  return {Vec3d(v[0][0], v[0][1], v[0][2]), Vec3d(v[1][0], v[1][1], v[1][2])};
}

Affine3d ObjectView::transform(std::string_view key) const {
  const auto v = numbers(key);
  Affine3d m;
  if (!v.empty())
    for (std::size_t i = 0; i < 12; ++i) m.m[i / 4][i % 4] = v[i];
  return m;
}

ObjectView ObjectView::object(std::string_view key) const {
  static const json kEmpty = json::object();
  const auto it = value_->find(std::string(key));
  return {*document_, it != value_->end() ? *it : kEmpty, *key_schema(key).object, pointer(key)};
}

std::vector<ObjectView> ObjectView::objects(std::string_view key) const {
  std::vector<ObjectView> out;
  if (!has(key)) return out;
  const json& list = value_->at(std::string(key));
  for (std::size_t i = 0; i < list.size(); ++i)
    out.emplace_back(*document_, list[i], *key_schema(key).object, child_pointer(pointer(key), i));
  return out;
}

std::vector<std::pair<std::string, ObjectView>> ObjectView::object_map(std::string_view key) const {
  std::vector<std::pair<std::string, ObjectView>> out;
  if (!has(key)) return out;
  for (const auto& [name, member] : value_->at(std::string(key)).items())
    out.emplace_back(name, ObjectView(*document_, member, *key_schema(key).object,
                                      child_pointer(pointer(key), name)));
  return out;
}

}  // namespace brume
