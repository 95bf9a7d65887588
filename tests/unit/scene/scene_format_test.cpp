// The schema, the page and the parser come from one table; these tests hold them to it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "core/error.h"
#include "scene/json_text.h"
#include "scene/scene_check.h"
#include "scene/scene_file.h"
#include "scene/scene_keys.h"

namespace brume {
namespace {

using nlohmann::json;

// The format's example as it was agreed with its users (scene_example() adds a named camera).
constexpr const char* kAgreedExample = R"({ "version": 1, "unit": 1.0, "up": "Y",
  "include": ["room.glb"],
  "camera": {"position": [0,1,4], "look_at": [0,1,0], "up": [0,1,0], "fov_deg": 40},
  "film": {"resolution": [1024, 768]},
  "meshes": [{"file": "box.obj", "material": "white", "casts_shadow": true,
              "transform": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]},
             {"file": "room.obj", "materials": {"mtl_name": "white"}}],
  "materials": {"white": {"type": "diffuse", "albedo": [0.75,0.75,0.75]},
                "floor": {"type": "glossy", "albedo": [0.2,0.2,0.2], "specular": [0.5,0.5,0.5], "roughness": 0.2},
                "glow":  {"type": "diffuse", "albedo": [0,0,0], "emission": [4,4,4], "direct": false, "two_sided": false}},
  "lights": [{"type": "point", "position": [0,1.9,0], "intensity": [10,10,10]},
             {"type": "spot", "position": [0,3,0], "direction": [0,-1,0], "intensity": [9,9,9], "inner_deg": 10, "outer_deg": 14},
             {"type": "directional", "direction": [0,-1,0], "irradiance": [3,3,3]},
             {"type": "quad", "corner": [0,2,0], "edge_u": [1,0,0], "edge_v": [0,0,1], "radiance": [25,25,25]},
             {"type": "environment", "file": "sky.exr", "scale": 1, "rotation_deg": 0}],
  "volumes": [
    {"type": "vdb", "file": "smoke.vdb", "transform": [],
     "grids": {"density": "density", "temperature": "temperature"},
     "density_scale": 8, "albedo": [0.92,0.9,0.88], "anisotropy": 0.3,
     "emission": {"mode": "blackbody", "temperature_scale": 1800, "scale": 0.2}},
    {"type": "homogeneous", "bounds": [[-5,0,-5],[5,3,5]], "sigma_s": [0.01,0.01,0.01], "sigma_a": [0,0,0]}],
  "render": {"bounces": 4, "volume_bounces": "auto", "seed": 1, "cells": [16,50]},
  "cache": {"file": "shot.irc", "mode": "missing"},
  "outputs": [{"file": "out.exr", "aovs": ["beauty", "diffuse_indirect", "volume_direct"]}] })";

// All property names below an object of the schema, its kinds together.
std::set<std::string> schema_keys(const json& object) {
  std::set<std::string> keys;
  if (object.contains("properties"))
    for (const auto& [name, unused] : object["properties"].items()) keys.insert(name);
  if (object.contains("oneOf"))
    for (const json& kind : object["oneOf"]) keys.merge(schema_keys(kind));
  return keys;
}

// A small validator of the parts of JSON Schema that ours uses: an opinion apart from the parser's.
bool validates(const json& value, const json& schema, const json& root) {
  if (schema.contains("$ref")) {
    const json::json_pointer at(schema["$ref"].get<std::string>().substr(1));
    return validates(value, root.at(at), root);
  }
  if (schema.contains("const") && value != schema["const"]) return false;
  if (schema.contains("enum")) {
    bool found = false;
    for (const json& choice : schema["enum"]) found = found || choice == value;
    if (!found) return false;
  }
  if (schema.contains("type")) {
    const std::string type = schema["type"];
    const bool ok = type == "object"    ? value.is_object()
                    : type == "array"   ? value.is_array()
                    : type == "string"  ? value.is_string()
                    : type == "boolean" ? value.is_boolean()
                    : type == "integer" ? value.is_number() &&
                                              value.get<double>() == std::floor(value.get<double>())
                                        : value.is_number();
    if (!ok) return false;
  }
  if (value.is_number()) {
    const double x = value.get<double>();
    if (schema.contains("minimum") && x < schema["minimum"].get<double>()) return false;
    if (schema.contains("maximum") && x > schema["maximum"].get<double>()) return false;
    if (schema.contains("exclusiveMinimum") && x <= schema["exclusiveMinimum"].get<double>())
      return false;
    if (schema.contains("exclusiveMaximum") && x >= schema["exclusiveMaximum"].get<double>())
      return false;
  }
  if (value.is_array()) {
    if (schema.contains("minItems") && value.size() < schema["minItems"]) return false;
    if (schema.contains("maxItems") && value.size() > schema["maxItems"]) return false;
    if (schema.contains("items"))
      for (const json& entry : value)
        if (!validates(entry, schema["items"], root)) return false;
  }
  if (value.is_object()) {
    if (schema.contains("required"))
      for (const json& name : schema["required"])
        if (!value.contains(name.get<std::string>())) return false;
    for (const auto& [name, member] : value.items()) {
      if (schema.contains("properties") && schema["properties"].contains(name)) {
        if (!validates(member, schema["properties"][name], root)) return false;
      } else if (schema.contains("additionalProperties")) {
        const json& rest = schema["additionalProperties"];
        if (rest.is_boolean() ? !rest.get<bool>() : !validates(member, rest, root)) return false;
      }
    }
  }
  if (schema.contains("oneOf")) {
    int matches = 0;
    for (const json& kind : schema["oneOf"]) matches += validates(value, kind, root);
    if (matches != 1) return false;
  }
  return true;
}

bool is_accepted(const json& scene) {
  const SceneDocument document("scene.json");
  try {
    check_scene_document(document, scene);
    return true;
  } catch (const Error&) {
    return false;
  }
}

TEST(SceneFormat, EveryKeyOfTheAgreedExampleParses) {
  const json example = parse_json_text(kAgreedExample, "example");
  EXPECT_NO_THROW(check_scene_document(SceneDocument("example"), example));
  EXPECT_TRUE(is_accepted(parse_json_text(scene_example(), "example")));
}

TEST(SceneFormat, SchemaListsExactlyTheKeysThatParse) {
  const json schema = json::parse(scene_schema());
  EXPECT_EQ(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
  std::set<std::string> objects;
  for (const ObjectSchema* object : all_scene_objects()) {
    std::set<std::string> keys;
    for (const KeySchema& key : object->keys) keys.emplace(key.name);
    const bool is_root = object == &scene_object();
    const json& listed = is_root ? schema : schema["$defs"][std::string(object->name)];
    EXPECT_EQ(schema_keys(listed), keys) << object->name;
    if (!is_root) objects.emplace(object->name);
  }
  std::set<std::string> defined;
  for (const auto& [name, unused] : schema["$defs"].items()) defined.insert(name);
  EXPECT_EQ(defined, objects);
}

TEST(SceneFormat, SchemaAndParserAgreeOnEveryMutantOfTheExample) {
  const json schema = json::parse(scene_schema());
  const json example = parse_json_text(scene_example(), "example");
  ASSERT_TRUE(validates(example, schema, schema));
  // Each leaf and each object in turn becomes each of these, or goes, or gains a key.
  const std::vector<json> strangers{nullptr,
                                    true,
                                    -1,
                                    0,
                                    0.5,
                                    1,
                                    2.5,
                                    1000,
                                    1e40,
                                    "auto",
                                    "x",
                                    json::array(),
                                    json::object(),
                                    {1, 2, 3},
                                    {{1, 2}, {3, 4}}};
  int accepted = 0, refused = 0;
  const auto compare = [&](const json& mutant, const std::string& what) {
    // What the schema cannot say: transforms that are singular, boxes turned over, paths of no
    // length.
    const bool ok = is_accepted(mutant), valid = validates(mutant, schema, schema);
    EXPECT_EQ(ok, valid) << what;
    ++(ok ? accepted : refused);
  };
  const json flat = example.flatten();
  for (const auto& [pointer, unused] : flat.items()) {
    if (pointer.find("/transform") != std::string::npos ||
        pointer.find("/bounds") != std::string::npos)
      continue;
    for (json::json_pointer at(pointer); !at.empty(); at.pop_back()) {
      for (const json& stranger : strangers) {
        json mutant = example;
        mutant[at] = stranger;
        compare(mutant, at.to_string() + " = " + stranger.dump());
      }
      json mutant = example;
      json& parent = mutant[at.parent_pointer()];
      if (!parent.is_object()) continue;
      parent["extra"] = 1;
      compare(mutant, at.parent_pointer().to_string() + " with a key more");
      parent.erase("extra");
      parent.erase(at.back());
      compare(mutant, "without " + at.to_string());
    }
  }
  EXPECT_GT(accepted, 100);
  EXPECT_GT(refused, 1000);
}

TEST(SceneFormat, DefaultsOfTheTableAreValidThemselves) {
  for (const ObjectSchema* object : all_scene_objects())
    for (const KeySchema& key : object->keys)
      if (!key.fallback.empty()) {
        const json fallback = json::parse(key.fallback, nullptr, false);
        ASSERT_FALSE(fallback.is_discarded()) << object->name << " " << key.name;
        if (key.type == KeyType::Number || key.type == KeyType::Integer) {
          EXPECT_TRUE(key.range.contains(fallback.get<double>()))
              << object->name << " " << key.name;
        } else if (key.type == KeyType::Choice) {
          EXPECT_THAT(key.choices, testing::Contains(fallback.get<std::string>()));
        }
      }
}

TEST(SceneFormat, PageIsTheTables) {
  std::ifstream in(std::string(BRUME_SOURCE_DIR) + "/docs/scene_format.md");
  ASSERT_TRUE(in) << "docs/scene_format.md is missing";
  std::stringstream page;
  page << in.rdbuf();
  EXPECT_EQ(page.str(), scene_format_page())
      << "write it anew: brume scene schema --markdown > docs/scene_format.md";
}

TEST(NameHint, FindsSwapsAndSmallMistakes) {
  EXPECT_EQ(name_hint("albeod", {"albedo", "anisotropy"}), "did you mean \"albedo\"?");
  EXPECT_EQ(name_hint("xyz", {"albedo", "anisotropy"}), "known are albedo, anisotropy");
  EXPECT_EQ(name_hint("x", {}), "there are none here");
}

}  // namespace
}  // namespace brume
