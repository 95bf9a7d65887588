// Checks a scene document against the table of keys, and hands out its values.
//
// check_scene_document() refuses everything the table can know about: unknown keys, types, ranges,
// missing keys. What remains are questions between keys, which scene_file.cpp asks. An ObjectView
// reads checked values only, and only keys that the table has, so nothing is parsed that the schema
// does not list.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "core/math.h"
#include "scene/scene_keys.h"

namespace brume {

// Where messages say that something is wrong.
class SceneDocument {
 public:
  explicit SceneDocument(std::string file) : file_(std::move(file)) {}

  const std::string& file() const { return file_; }

  // Applies "/json/pointer=value"; value is JSON, or else a string. Keys may be created, list
  // entries appended. Throws Error(Usage) for what is not of this form, Error(InvalidInput) where
  // the pointer leads nowhere.
  void apply_override(nlohmann::json& root, const std::string& text);

  // Throws Error(InvalidInput) `FILE: pointer: what: what to do`, naming the override that set the
  // value where one did.
  [[noreturn]] void fail(const std::string& pointer, const std::string& what,
                         const std::string& what_to_do) const;

 private:
  struct Override {
    std::string pointer, text;
  };
  std::string file_;
  std::vector<Override> overrides_;
};

void check_scene_document(const SceneDocument& document, const nlohmann::json& root);

// One object of a checked document. Cheap to copy; the document and the JSON must outlive it.
class ObjectView {
 public:
  ObjectView(const SceneDocument& document, const nlohmann::json& value, const ObjectSchema& schema,
             std::string pointer)
      : document_(&document), value_(&value), schema_(&schema), pointer_(std::move(pointer)) {}

  const std::string& pointer() const { return pointer_; }
  std::string pointer(std::string_view key) const;
  [[noreturn]] void fail(const std::string& what, const std::string& what_to_do) const {
    document_->fail(pointer_, what, what_to_do);
  }
  [[noreturn]] void fail(std::string_view key, const std::string& what,
                         const std::string& what_to_do) const {
    document_->fail(pointer(key), what, what_to_do);
  }

  // Whether the file gives the key; the getters below fall back on the table's default, and may be
  // called without one only if the key is there.
  bool has(std::string_view key) const;
  double number(std::string_view key) const;
  std::int64_t integer(std::string_view key) const;
  bool is_auto(std::string_view key) const;  // AutoOrInteger only.
  bool boolean(std::string_view key) const;
  std::string text(std::string_view key) const;  // Text, Path, Choice.
  std::vector<double> numbers(std::string_view key) const;
  std::vector<std::string> texts(std::string_view key) const;  // Paths, Choices.
  std::vector<std::pair<std::string, std::string>> text_map(std::string_view key) const;
  Vec3d vector(std::string_view key) const;
  Rgb color(std::string_view key) const;
  Box3d box(std::string_view key) const;
  Affine3d transform(std::string_view key) const;

  ObjectView object(std::string_view key) const;
  std::vector<ObjectView> objects(std::string_view key) const;
  std::vector<std::pair<std::string, ObjectView>> object_map(std::string_view key) const;

 private:
  const KeySchema& key_schema(std::string_view key) const;
  nlohmann::json value(std::string_view key) const;

  const SceneDocument* document_;
  const nlohmann::json* value_;
  const ObjectSchema* schema_;
  std::string pointer_;
};

// `did you mean "albedo"?` where a known name is near, else `one of a, b, c`.
std::string name_hint(const std::string& name, const std::vector<std::string>& known);

}  // namespace brume
