// The scene format told from its table: as a JSON Schema for programs, as a page for people.
#include <nlohmann/json.hpp>
#include <sstream>

#include "scene/scene_file.h"
#include "scene/scene_keys.h"

namespace brume {
namespace {

using nlohmann::ordered_json;

std::string type_text(const KeySchema& key) {
  switch (key.type) {
    case KeyType::Number:
      return "number";
    case KeyType::Integer:
      return "integer";
    case KeyType::AutoOrInteger:
      return "`\"auto\"` or integer";
    case KeyType::Boolean:
      return "boolean";
    case KeyType::Text:
      return "string";
    case KeyType::Path:
      return "path";
    case KeyType::Choice:
      return "choice";
    case KeyType::Numbers:
      return std::to_string(key.count) + " numbers";
    case KeyType::Integers:
      return std::to_string(key.count) + " integers";
    case KeyType::Box:
      return "2 lists of 3 numbers";
    case KeyType::Transform:
      return "16 or 0 numbers";
    case KeyType::Paths:
      return "list of paths";
    case KeyType::Choices:
      return "list of choices";
    case KeyType::Object:
      return "[" + std::string(key.object->name) + "](#" + std::string(key.object->name) + ")";
    case KeyType::ObjectList:
      return "list of [" + std::string(key.object->name) + "](#" + std::string(key.object->name) +
             ")";
    case KeyType::ObjectMap:
      return "name to [" + std::string(key.object->name) + "](#" + std::string(key.object->name) +
             ")";
    case KeyType::TextMap:
      return "name to name";
  }
  return "";
}

void add_range(ordered_json& schema, const NumberRange& range) {
  if (range.min > -std::numeric_limits<double>::infinity())
    schema[range.open_min ? "exclusiveMinimum" : "minimum"] = range.min;
  if (range.max < std::numeric_limits<double>::infinity())
    schema[range.open_max ? "exclusiveMaximum" : "maximum"] = range.max;
}

ordered_json number_schema(const char* type, const NumberRange& range) {
  ordered_json schema{{"type", type}};
  add_range(schema, range);
  return schema;
}

ordered_json list_schema(ordered_json items, std::size_t count) {
  return {{"type", "array"}, {"items", std::move(items)}, {"minItems", count}, {"maxItems", count}};
}

ordered_json reference(const ObjectSchema& object) {
  return {{"$ref", "#/$defs/" + std::string(object.name)}};
}

ordered_json type_schema(const KeySchema& key) {
  switch (key.type) {
    case KeyType::Number:
      return number_schema("number", key.range);
    case KeyType::Integer:
      return number_schema("integer", key.range);
    case KeyType::AutoOrInteger:
      return {{"oneOf", {{{"const", "auto"}}, number_schema("integer", key.range)}}};
    case KeyType::Boolean:
      return {{"type", "boolean"}};
    case KeyType::Text:
    case KeyType::Path:
      return {{"type", "string"}, {"minLength", 1}};
    case KeyType::Choice:
      return {{"enum", key.choices}};
    case KeyType::Numbers:
      return list_schema(number_schema("number", key.range), std::size_t(key.count));
    case KeyType::Integers:
      return list_schema(number_schema("integer", key.range), std::size_t(key.count));
    case KeyType::Box:
      return list_schema(list_schema(number_schema("number", key.range), 3), 2);
    case KeyType::Transform:
      return {
          {"oneOf", {list_schema({{"type", "number"}}, 16), list_schema({{"type", "number"}}, 0)}}};
    case KeyType::Paths:
      return {{"type", "array"},
              {"items", {{"type", "string"}, {"minLength", 1}}},
              {"uniqueItems", true}};
    case KeyType::Choices:
      return {{"type", "array"}, {"items", {{"enum", key.choices}}}, {"uniqueItems", true}};
    case KeyType::Object:
      return reference(*key.object);
    case KeyType::ObjectList:
      return {{"type", "array"}, {"items", reference(*key.object)}};
    case KeyType::ObjectMap:
      return {{"type", "object"}, {"additionalProperties", reference(*key.object)}};
    case KeyType::TextMap:
      return {{"type", "object"}, {"additionalProperties", {{"type", "string"}}}};
  }
  return {};
}

// The keys of one kind of the object, or of the object itself where it has no kinds.
ordered_json kind_schema(const ObjectSchema& object, std::string_view kind, bool is_default) {
  ordered_json properties = ordered_json::object(), required = ordered_json::array();
  for (const KeySchema& key : object.keys) {
    if (!key.belongs_to(kind)) continue;
    ordered_json property = type_schema(key);
    const bool is_discriminator = !kind.empty() && key.name == object.discriminator;
    if (is_discriminator) property = {{"const", kind}};
    property["description"] = key.doc;
    if (!key.fallback.empty() && !is_discriminator)
      property["default"] = ordered_json::parse(key.fallback);
    properties[std::string(key.name)] = std::move(property);
    if (key.required || (is_discriminator && !is_default)) required.push_back(key.name);
  }
  ordered_json schema{{"type", "object"}, {"properties", std::move(properties)}};
  if (!required.empty()) schema["required"] = std::move(required);
  schema["additionalProperties"] = false;
  return schema;
}

ordered_json object_schema(const ObjectSchema& object) {
  ordered_json schema{{"description", object.doc}};
  if (object.discriminator.empty()) {
    schema.update(kind_schema(object, "", false));
    return schema;
  }
  const KeySchema& discriminator = *object.find(object.discriminator);
  for (const std::string_view kind : discriminator.choices) {
    const bool is_default = discriminator.fallback == "\"" + std::string(kind) + "\"";
    schema["oneOf"].push_back(kind_schema(object, kind, is_default));
  }
  return schema;
}

std::string joined(const std::vector<std::string_view>& texts) {
  std::string out;
  for (const std::string_view t : texts) out += (out.empty() ? "`" : ", `") + std::string(t) + "`";
  return out;
}

void write_table(std::ostream& out, const ObjectSchema& object) {
  const bool has_kinds = !object.discriminator.empty();
  out << "| key | type | default | range |" << (has_kinds ? " of |" : "") << " meaning |\n"
      << "|---|---|---|---|" << (has_kinds ? "---|" : "") << "---|\n";
  for (const KeySchema& key : object.keys) {
    out << "| `" << key.name << "` | " << type_text(key) << " | ";
    if (key.required)
      out << "required";
    else if (!key.fallback.empty())
      out << "`" << key.fallback << "`";
    out << " | ";
    if (!key.choices.empty())
      out << joined(key.choices);
    else if (key.range.is_bounded())
      out << key.range.text();
    out << " |";
    if (has_kinds) out << " " << (key.kinds.empty() ? "all" : joined(key.kinds)) << " |";
    out << " " << key.doc << " |\n";
  }
}

constexpr const char* kPageHead = R"(# The scene file

A scene is one JSON file; `//` comments are allowed. It is read strictly: unknown keys, values of the
wrong type or out of range, and names that lead nowhere are errors that name the place by its JSON
pointer (`/volumes/0/albedo/2`). Check a file with `brume scene check FILE`, see what it holds with
`brume scene info FILE`. `brume scene schema` prints a JSON Schema (draft 2020-12) for editors.

- Paths are relative to the scene file. `${NAME}` expands to the environment variable. A run of two or
  more `#` is the frame number (`--frame N`), padded with zeros to the length of the run.
- `-D /json/pointer=value` overrides a value, and may be given often. The value is JSON, or else a
  string. Keys may be created and list entries appended (`/lights/-`).
- Positions, radii, bounds and coefficients are in scene units, of `unit` metres each; radiometry is in
  SI units. Colours are linear Rec.709.
- `transform` is row-major for column vectors: the translation stands at 3, 7 and 11.

This page is printed by `brume scene schema --markdown`, from the table that reads the file.

## Example

```json
)";

constexpr const char* kExample = R"({ "version": 1, "unit": 1.0, "up": "Y",
  "include": ["room.glb"],  // geometry, cameras and lights
  "camera": {"position": [0,1,4], "look_at": [0,1,0], "up": [0,1,0], "fov_deg": 40},
  "cameras": {"top": {"position": [0,9,0], "look_at": [0,0,0], "up": [0,0,-1]}},
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
  "outputs": [{"file": "out.exr", "aovs": ["beauty", "diffuse_indirect", "volume_direct"]}] }
)";

constexpr const char* kPageTail = R"(
## What mesh files bring

| file | brume reads | and drops, with a warning |
|---|---|---|
| OBJ with MTL | faces, normals, names of materials, `Kd`, `Ke` | `Ks`, transparency, images, points and lines |
| PLY | faces, normals | everything else |
| glTF, glb | nodes, faces, normals, base colour, emission (with its strength), two-sidedness; under `include` also perspective cameras and punctual lights (candela and lux over 683 lm/W) | images, transparency, animation, skins, other extensions |

A metallic glTF material becomes glossy: `specular` is metalness times base colour, `albedo` the rest.
Surfaces without a material are grey, albedo 0.5. Faces without normals in the file are flat.
)";

}  // namespace

std::string scene_schema() {
  ordered_json schema{{"$schema", "https://json-schema.org/draft/2020-12/schema"},
                      {"title", "brume scene, version 1"}};
  schema.update(object_schema(scene_object()));
  for (const ObjectSchema* object : all_scene_objects())
    if (object != &scene_object())
      schema["$defs"][std::string(object->name)] = object_schema(*object);
  return schema.dump(2) + "\n";
}

std::string scene_example() { return kExample; }

std::string scene_format_page() {
  std::ostringstream out;
  out << kPageHead << kExample << "```\n";
  for (const ObjectSchema* object : all_scene_objects()) {
    out << "\n## " << object->name << "\n\n" << object->doc << "\n\n";
    write_table(out, *object);
  }
  out << kPageTail;
  return out.str();
}

}  // namespace brume
