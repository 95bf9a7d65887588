// The scene format, once: every object of a scene file with its keys, types, defaults, ranges and
// meaning. Checking (scene_check.h), the JSON Schema and the documentation page are made from this.
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace brume {

enum class KeyType {
  Number,
  Integer,
  AutoOrInteger,  // "auto" or an integer.
  Boolean,
  Text,
  Path,  // Relative to the scene file; ${ENV} expands.
  Choice,
  Numbers,    // A list of `count` numbers.
  Integers,   // A list of `count` integers.
  Box,        // [[min x, y, z], [max x, y, z]], each min below its max.
  Transform,  // 16 numbers, row-major, or an empty list.
  Paths,
  Choices,  // A list of distinct choices.
  Object,
  ObjectList,
  ObjectMap,  // Names of the user's choosing.
  TextMap,
};

// Which numbers are allowed. Open ends exclude their own value.
struct NumberRange {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool open_min = false, open_max = false;

  bool contains(double x) const {
    return (open_min ? x > min : x >= min) && (open_max ? x < max : x <= max);
  }
  bool is_bounded() const;
  std::string text() const;  // "[0, 1]", "(0, 180)", "at least 0".
};

struct ObjectSchema;

struct KeySchema {
  std::string_view name;
  KeyType type;
  std::string_view doc;
  bool required = false;
  // JSON text that stands in where the key is absent; empty: absence has a meaning of its own.
  std::string_view fallback = {};
  NumberRange range = {};
  int count = 0;
  std::vector<std::string_view> choices = {};
  const ObjectSchema* object = nullptr;
  // Kinds of the object (values of its discriminator) that have this key; empty: all.
  std::vector<std::string_view> kinds = {};

  bool belongs_to(std::string_view kind) const;
};

struct ObjectSchema {
  std::string_view name;  // "volume", as in messages and the schema's $defs.
  std::string_view doc;
  // The key, of type Choice, whose value decides which others are allowed; empty: none.
  std::string_view discriminator;
  std::vector<KeySchema> keys;

  // The key as an object of this kind has it, else as another kind has it, else null.
  const KeySchema* find(std::string_view key, std::string_view kind = {}) const;
};

// The whole file.
const ObjectSchema& scene_object();
// All objects of the format, the file first, each once, in the order of the documentation.
std::vector<const ObjectSchema*> all_scene_objects();

}  // namespace brume
