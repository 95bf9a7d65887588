#include "scene/scene_keys.h"

#include <algorithm>
#include <cstdio>

namespace brume {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr NumberRange kUnitInterval{0, 1};
// Floats hold what these bound, with room for sums and products.
constexpr NumberRange kRadiometric{0, 1e30};
constexpr NumberRange kCoefficient{0, 1e30};
constexpr NumberRange kCoordinate{-1e15, 1e15};

const ObjectSchema& camera_object() {
  static const ObjectSchema schema{
      "camera",
      "A pinhole camera.",
      "",
      {{"position", KeyType::Numbers, "Where the eye is.", true, "", kCoordinate, 3},
       {"look_at", KeyType::Numbers, "A point in the middle of the picture.", true, "", kCoordinate,
        3},
       {"up", KeyType::Numbers,
        "What is up in the picture; not parallel to the view. Default: the scene's `up` axis.",
        false, "", kCoordinate, 3},
       {"fov_deg", KeyType::Number, "Vertical field of view in degrees.", false, "40",
        NumberRange{0, 180, true, true}}}};
  return schema;
}

const ObjectSchema& film_object() {
  static const ObjectSchema schema{"film",
                                   "The picture.",
                                   "",
                                   {{"resolution", KeyType::Integers,
                                     "Width and height in pixels, at most 2^28 pixels together.",
                                     false, "[640, 480]", NumberRange{1, 65536}, 2}}};
  return schema;
}

const ObjectSchema& mesh_object() {
  static const ObjectSchema schema{
      "mesh",
      "Triangles from an OBJ, PLY, glTF or glb file.",
      "",
      {{"file", KeyType::Path, "The mesh file.", true},
       {"material", KeyType::Text, "Name of a material for the whole file; overrides all else."},
       {"materials", KeyType::TextMap,
        "Names of materials in the file to names in `materials`. What is not mapped uses what the "
        "file says (MTL: Kd, Ke; glTF: base colour, metalness, roughness, emission)."},
       {"casts_shadow", KeyType::Boolean, "`false` leaves it out of shadow rays, and only those.",
        false, "true"},
       {"transform", KeyType::Transform,
        "16 numbers, row-major, for column vectors; empty is identity.", false, "[]"}}};
  return schema;
}

const ObjectSchema& material_object() {
  static const ObjectSchema schema{
      "material",
      "How a surface reflects and glows. Surfaces reflect on both sides.",
      "type",
      {{"type",
        KeyType::Choice,
        "`diffuse`, or `glossy`: diffuse and a microfacet lobe (GGX).",
        false,
        "\"diffuse\"",
        {},
        0,
        {"diffuse", "glossy"}},
       {"albedo", KeyType::Numbers, "Diffuse reflectance.", false, "[0.5, 0.5, 0.5]", kUnitInterval,
        3},
       {"specular",
        KeyType::Numbers,
        "Reflectance of the microfacet lobe.",
        false,
        "[0.04, 0.04, 0.04]",
        kUnitInterval,
        3,
        {},
        nullptr,
        {"glossy"}},
       {"roughness",
        KeyType::Number,
        "The lobe's alpha is its square.",
        false,
        "0.5",
        NumberRange{0.01, 1},
        0,
        {},
        nullptr,
        {"glossy"}},
       {"emission", KeyType::Numbers, "Emitted radiance [W/(m^2 sr)].", false, "[0, 0, 0]",
        kRadiometric, 3},
       {"direct", KeyType::Boolean,
        "An emissive material is a light: sampled directly, not seen by the gather. `false`: only "
        "the "
        "gather sees it.",
        false, "true"},
       {"two_sided", KeyType::Boolean,
        "Emits on both sides, not only on the one that counter-clockwise winding faces.", false,
        "false"}}};
  return schema;
}

const ObjectSchema& light_object() {
  static const ObjectSchema schema{"light",
                                   "A light that is no mesh.",
                                   "type",
                                   {{"type",
                                     KeyType::Choice,
                                     "The kind of light.",
                                     true,
                                     "",
                                     {},
                                     0,
                                     {"point", "spot", "directional", "quad", "environment"}},
                                    {"position",
                                     KeyType::Numbers,
                                     "Where it is.",
                                     true,
                                     "",
                                     kCoordinate,
                                     3,
                                     {},
                                     nullptr,
                                     {"point", "spot"}},
                                    {"direction",
                                     KeyType::Numbers,
                                     "The way the light travels; any length but 0.",
                                     true,
                                     "",
                                     kCoordinate,
                                     3,
                                     {},
                                     nullptr,
                                     {"spot", "directional"}},
                                    {"intensity",
                                     KeyType::Numbers,
                                     "[W/sr]; of a spot inside `inner_deg`.",
                                     true,
                                     "",
                                     kRadiometric,
                                     3,
                                     {},
                                     nullptr,
                                     {"point", "spot"}},
                                    {"inner_deg",
                                     KeyType::Number,
                                     "Half angle of the full cone; at most `outer_deg`.",
                                     false,
                                     "30",
                                     NumberRange{0, 90},
                                     0,
                                     {},
                                     nullptr,
                                     {"spot"}},
                                    {"outer_deg",
                                     KeyType::Number,
                                     "Half angle at which the light has smoothly fallen to 0.",
                                     false,
                                     "40",
                                     NumberRange{0, 90, true},
                                     0,
                                     {},
                                     nullptr,
                                     {"spot"}},
                                    {"irradiance",
                                     KeyType::Numbers,
                                     "[W/m^2] on a facing surface.",
                                     true,
                                     "",
                                     kRadiometric,
                                     3,
                                     {},
                                     nullptr,
                                     {"directional"}},
                                    {"corner",
                                     KeyType::Numbers,
                                     "A corner of the parallelogram.",
                                     true,
                                     "",
                                     kCoordinate,
                                     3,
                                     {},
                                     nullptr,
                                     {"quad"}},
                                    {"edge_u",
                                     KeyType::Numbers,
                                     "One edge from the corner.",
                                     true,
                                     "",
                                     kCoordinate,
                                     3,
                                     {},
                                     nullptr,
                                     {"quad"}},
                                    {"edge_v",
                                     KeyType::Numbers,
                                     "The other; light leaves on the side of `edge_u` x `edge_v`.",
                                     true,
                                     "",
                                     kCoordinate,
                                     3,
                                     {},
                                     nullptr,
                                     {"quad"}},
                                    {"radiance",
                                     KeyType::Numbers,
                                     "[W/(m^2 sr)]",
                                     true,
                                     "",
                                     kRadiometric,
                                     3,
                                     {},
                                     nullptr,
                                     {"quad"}},
                                    {"radiance",
                                     KeyType::Numbers,
                                     "[W/(m^2 sr)], the same from everywhere, instead of `file`.",
                                     false,
                                     "",
                                     kRadiometric,
                                     3,
                                     {},
                                     nullptr,
                                     {"environment"}},
                                    {"file",
                                     KeyType::Path,
                                     "A latitude-longitude image, linear (EXR, HDR).",
                                     false,
                                     "",
                                     {},
                                     0,
                                     {},
                                     nullptr,
                                     {"environment"}},
                                    {"scale",
                                     KeyType::Number,
                                     "Multiplies the image or the radiance.",
                                     false,
                                     "1",
                                     kRadiometric,
                                     0,
                                     {},
                                     nullptr,
                                     {"environment"}},
                                    {"rotation_deg",
                                     KeyType::Number,
                                     "Turns it about the scene's `up` axis.",
                                     false,
                                     "0",
                                     NumberRange{-1e6, 1e6},
                                     0,
                                     {},
                                     nullptr,
                                     {"environment"}}}};
  return schema;
}

const ObjectSchema& grids_object() {
  static const ObjectSchema schema{
      "grids",
      "Which grid of the file is read as what; `name[i]` picks one of several of one name. A role "
      "that "
      "is not named takes the first of its usual names that the file has.",
      "",
      {{"density", KeyType::Text, "Usual names: density, dens."},
       {"temperature", KeyType::Text,
        "For emission `blackbody`. Usual names: temperature, temp, heat."},
       {"flame", KeyType::Text,
        "For emission `grid` where there is no emission grid. Usual names: flame, flames, burn."},
       {"emission", KeyType::Text, "For emission `grid`. Usual name: emission."},
       {"color", KeyType::Text,
        "Multiplies the albedo, the extinction stays. Read only if it is named here."}}};
  return schema;
}

const ObjectSchema& emission_object() {
  static const ObjectSchema schema{
      "emission",
      "Light that a volume gives off, as source per length.",
      "mode",
      {{"mode",
        KeyType::Choice,
        "`density`: scale color sigma_t; `grid`: scale color grid; `blackbody`: "
        "scale sigma_a B(temperature_scale T), Planck radiance in linear Rec.709.",
        false,
        "\"none\"",
        {},
        0,
        {"none", "density", "grid", "blackbody"}},
       {"scale",
        KeyType::Number,
        "Multiplies the source.",
        false,
        "1",
        kRadiometric,
        0,
        {},
        nullptr,
        {"density", "grid", "blackbody"}},
       {"color",
        KeyType::Numbers,
        "Multiplies the source.",
        false,
        "[1, 1, 1]",
        kRadiometric,
        3,
        {},
        nullptr,
        {"density", "grid"}},
       {"temperature_scale",
        KeyType::Number,
        "Kelvin per unit of the temperature grid.",
        false,
        "1",
        kRadiometric,
        0,
        {},
        nullptr,
        {"blackbody"}}}};
  return schema;
}

const ObjectSchema& volume_object() {
  static const ObjectSchema schema{
      "volume",
      "A medium; overlapping volumes add up. Extinction is `density_scale` x density per scene "
      "unit, "
      "of which `albedo` scatters; or `sigma_s` and `sigma_a` per unit density instead of both.",
      "type",
      {{"type",
        KeyType::Choice,
        "`vdb`: an OpenVDB file; `homogeneous`: density 1.",
        true,
        "",
        {},
        0,
        {"vdb", "homogeneous"}},
       {"file",
        KeyType::Path,
        "The OpenVDB file; a run of `#` is the frame number.",
        true,
        "",
        {},
        0,
        {},
        nullptr,
        {"vdb"}},
       {"transform",
        KeyType::Transform,
        "16 numbers, row-major, for column vectors, applied after the grid's own transform; empty "
        "is "
        "identity.",
        false,
        "[]",
        {},
        0,
        {},
        nullptr,
        {"vdb"}},
       {"grids",
        KeyType::Object,
        "Which grid is read as what.",
        false,
        "{}",
        {},
        0,
        {},
        &grids_object(),
        {"vdb"}},
       {"bounds",
        KeyType::Box,
        "[[min], [max]]; without it the volume fills all space, which no directional or "
        "environment "
        "light can cross.",
        false,
        "",
        kCoordinate,
        0,
        {},
        nullptr,
        {"homogeneous"}},
       {"density_scale", KeyType::Number,
        "Extinction per unit density [1/scene unit]; 1 for a `vdb` without it and without "
        "coefficients.",
        false, "", kCoefficient},
       {"albedo", KeyType::Numbers,
        "Scattering over extinction; 0.9 where neither it nor coefficients are given.", false, "",
        kUnitInterval, 3},
       {"sigma_s", KeyType::Numbers,
        "Scattering coefficient per unit density [1/scene unit]; 0 if only `sigma_a` is given.",
        false, "", kCoefficient, 3},
       {"sigma_a", KeyType::Numbers,
        "Absorption coefficient per unit density [1/scene unit]; 0 if only `sigma_s` is given.",
        false, "", kCoefficient, 3},
       {"anisotropy", KeyType::Number,
        "Mean cosine g of Henyey-Greenstein scattering; positive is forward.", false, "0",
        NumberRange{-1, 1, true, true}},
       {"emission",
        KeyType::Object,
        "What it gives off.",
        false,
        "{}",
        {},
        0,
        {},
        &emission_object()}}};
  return schema;
}

const ObjectSchema& render_object() {
  static const ObjectSchema schema{
      "render",
      "How light is followed.",
      "",
      {{"bounces", KeyType::Integer,
        "Light may be reflected by surfaces at most so often before the reflection or scattering "
        "that "
        "the eye sees; 0 is direct light only.",
        false, "4", NumberRange{0, 10000}},
       {"volume_bounces", KeyType::AutoOrInteger,
        "0: no scattering; 1: only light straight from lights scatters; n; \"auto\": as many as "
        "matter.",
        false, "\"auto\"", NumberRange{0, 10000}},
       {"seed", KeyType::Integer, "Of all random numbers.", false, "1",
        NumberRange{0, 9007199254740992.0}},
       {"cells", KeyType::Integers, "Hemisphere strata of a gather: along theta and phi.", false,
        "[20, 64]", NumberRange{1, 4096}, 2},
       {"shells", KeyType::Integer, "Shells of a gather's march; 0 is automatic.", false, "0",
        NumberRange{0, 65536}},
       {"footprint", KeyType::Number,
        "Gathers march in steps as long as this share of the width that a ray stands for; 0: cell "
        "by "
        "cell.",
        false, "1", NumberRange{0, 16}},
       {"lamp_samples", KeyType::Integer,
        "Samples of lights that a gather's ray asks for in the medium; 0: one of each light from "
        "each "
        "shell.",
        false, "4", NumberRange{0, 65536}},
       {"step_voxels", KeyType::Number,
        "Least march step in voxels, smaller is finer; 0 is automatic.", false, "0",
        NumberRange{0, 1000}}}};
  return schema;
}

const ObjectSchema& cache_object() {
  static const ObjectSchema schema{
      "cache",
      "Where records are kept.",
      "",
      {{"file", KeyType::Path, "The cache; a run of `#` is the frame number.", true},
       {"mode",
        KeyType::Choice,
        "`new` replaces, `append` adds what these views need, `missing` resumes or fills, `read` "
        "never "
        "bakes.",
        false,
        "\"missing\"",
        {},
        0,
        {"new", "append", "missing", "read"}}}};
  return schema;
}

const ObjectSchema& output_object() {
  static const ObjectSchema schema{
      "output",
      "An image to write.",
      "",
      {{"file", KeyType::Path, "The EXR file; a run of `#` is the frame number.", true},
       {"aovs",
        KeyType::Choices,
        "Its layers; empty is all.",
        false,
        "[]",
        {},
        0,
        {"beauty", "diffuse_direct", "diffuse_indirect", "glossy_direct", "glossy_indirect",
         "volume_direct", "volume_indirect", "volume_emission", "emission", "background", "Z", "N",
         "P", "albedo", "transmittance", "cache_count", "cost"}}}};
  return schema;
}

std::string number_text(double x) {
  char text[32];
  std::snprintf(text, sizeof text, "%.16g", x);
  return text;
}

}  // namespace

bool NumberRange::is_bounded() const { return min > -kInf || max < kInf; }

std::string NumberRange::text() const {
  if (max == kInf) return (open_min ? "above " : "at least ") + number_text(min);
  if (min == -kInf) return (open_max ? "below " : "at most ") + number_text(max);
  return (open_min ? "(" : "[") + number_text(min) + ", " + number_text(max) +
         (open_max ? ")" : "]");
}

bool KeySchema::belongs_to(std::string_view kind) const {
  return kinds.empty() || std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
}

const KeySchema* ObjectSchema::find(std::string_view key, std::string_view kind) const {
  const KeySchema* found = nullptr;
  for (const KeySchema& k : keys)
    if (k.name == key && (!found || k.belongs_to(kind))) found = &k;
  return found;
}

const ObjectSchema& scene_object() {
  static const ObjectSchema schema{
      "scene",
      "A scene file.",
      "",
      {{"version", KeyType::Integer, "Version of this format.", true, "", NumberRange{1, 1}},
       {"unit", KeyType::Number, "Metres per scene unit.", false, "1", NumberRange{1e-9, 1e9}},
       {"up",
        KeyType::Choice,
        "Which axis is up; only orients defaults.",
        false,
        "\"Y\"",
        {},
        0,
        {"X", "Y", "Z"}},
       {"include", KeyType::Paths,
        "Mesh files to take whole: geometry with the file's materials, cameras and lights.", false,
        "[]"},
       {"camera",
        KeyType::Object,
        "The camera of a scene with one.",
        false,
        "",
        {},
        0,
        {},
        &camera_object()},
       {"cameras",
        KeyType::ObjectMap,
        "Named cameras, beside or instead of `camera`.",
        false,
        "{}",
        {},
        0,
        {},
        &camera_object()},
       {"film", KeyType::Object, "The picture.", false, "{}", {}, 0, {}, &film_object()},
       {"meshes", KeyType::ObjectList, "Surfaces.", false, "[]", {}, 0, {}, &mesh_object()},
       {"materials",
        KeyType::ObjectMap,
        "Materials by name.",
        false,
        "{}",
        {},
        0,
        {},
        &material_object()},
       {"lights",
        KeyType::ObjectList,
        "Lights that are no meshes.",
        false,
        "[]",
        {},
        0,
        {},
        &light_object()},
       {"volumes", KeyType::ObjectList, "Media.", false, "[]", {}, 0, {}, &volume_object()},
       {"render",
        KeyType::Object,
        "How light is followed.",
        false,
        "{}",
        {},
        0,
        {},
        &render_object()},
       {"cache",
        KeyType::Object,
        "Where records are kept; without it, in memory.",
        false,
        "",
        {},
        0,
        {},
        &cache_object()},
       {"outputs",
        KeyType::ObjectList,
        "Images to write.",
        false,
        "[]",
        {},
        0,
        {},
        &output_object()}}};
  return schema;
}

std::vector<const ObjectSchema*> all_scene_objects() {
  std::vector<const ObjectSchema*> found{&scene_object()};
  for (std::size_t i = 0; i < found.size(); ++i)
    for (const KeySchema& key : found[i]->keys)
      if (key.object && std::find(found.begin(), found.end(), key.object) == found.end())
        found.push_back(key.object);
  return found;
}

}  // namespace brume
