#include "scene/mesh_import.h"

#include <assimp/GltfMaterial.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cctype>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <set>

#include "core/error.h"
#include "scene/gltf_nodes.h"
#include "scene/input_file.h"

namespace brume {
namespace {

// Larger files are no scenes of ours; the importer holds a file several times over in memory.
constexpr std::uint64_t kMaxFileBytes = std::uint64_t{8} << 30;
constexpr int kMaxNodeDepth = 256;
// A surface that neither the file nor the scene describes.
constexpr Rgb kDefaultGrey{0.5f, 0.5f, 0.5f};
// The importer's own name for such a surface.
constexpr const char* kNoMaterial = AI_DEFAULT_MATERIAL_NAME;

class MemoryStream : public Assimp::IOStream {
 public:
  explicit MemoryStream(std::string bytes) : bytes_(std::move(bytes)) {}

  std::size_t Read(void* to, std::size_t size, std::size_t count) override {
    if (size == 0) return 0;
    const std::size_t whole = std::min(count, (bytes_.size() - at_) / size);
    std::memcpy(to, bytes_.data() + at_, whole * size);
    at_ += whole * size;
    return whole;
  }
  std::size_t Write(const void*, std::size_t, std::size_t) override { return 0; }
  aiReturn Seek(std::size_t offset, aiOrigin origin) override {
    const std::size_t base = origin == aiOrigin_SET   ? 0
                             : origin == aiOrigin_CUR ? at_
                                                      : bytes_.size();
    const std::size_t target = base + offset;
    if (target > bytes_.size() || target < base) return aiReturn_FAILURE;
    at_ = target;
    return aiReturn_SUCCESS;
  }
  std::size_t Tell() const override { return at_; }
  std::size_t FileSize() const override { return bytes_.size(); }
  void Flush() override {}

 private:
  std::string bytes_;
  std::size_t at_ = 0;
};

// Lets the importer see regular files inside the confinement and nothing else, and remembers what a
// material library defines, which the importer does not tell.
class FileSystem : public Assimp::IOSystem {
 public:
  FileSystem(const MeshImportOptions& options, std::filesystem::path main, std::string main_bytes)
      : options_(options), main_(std::move(main)), main_bytes_(std::move(main_bytes)) {}

  const std::set<std::string>& defined_materials() const { return defined_materials_; }
  const std::vector<std::string>& refusals() const { return refusals_; }

  bool Exists(const char* path) const override {
    std::error_code failed;
    return path == main_.string() || std::filesystem::is_regular_file(path, failed);
  }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* path, const char*) override {
    if (path == main_.string()) return new MemoryStream(main_bytes_);
    try {
      const auto file = std::filesystem::path(path).lexically_normal();
      check_confined(file, options_.confine);
      std::string bytes = read_regular_file(file, kMaxFileBytes);
      if (file.extension() == ".mtl") note_materials(bytes);
      return new MemoryStream(std::move(bytes));
    } catch (const Error& refused) {
      refusals_.push_back(refused.what());
      return nullptr;
    }
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  void note_materials(const std::string& mtl) {
    std::size_t begin = 0;
    while (begin < mtl.size()) {
      std::size_t end = std::min(mtl.find('\n', begin), mtl.size());
      std::string line = mtl.substr(begin, end - begin);
      begin = end + 1;
      const auto first = line.find_first_not_of(" \t\r");
      if (first == std::string::npos || line.compare(first, 7, "newmtl ") != 0) continue;
      line = line.substr(first + 7);
      const auto name_begin = line.find_first_not_of(" \t\r"),
                 name_end = line.find_last_not_of(" \t\r");
      if (name_begin != std::string::npos)
        defined_materials_.insert(line.substr(name_begin, name_end - name_begin + 1));
    }
  }

  const MeshImportOptions& options_;
  std::filesystem::path main_;
  std::string main_bytes_;
  std::set<std::string> defined_materials_;
  std::vector<std::string> refusals_;
};

Affine3d affine(const aiMatrix4x4& m) {
  Affine3d r;
  for (unsigned i = 0; i < 3; ++i)
    for (unsigned j = 0; j < 4; ++j) r.m[i][j] = m[i][j];
  return r;
}

bool is_finite(const aiVector3D& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

class Importer {
 public:
  Importer(const std::filesystem::path& file, const MeshImportOptions& options)
      : file_(file), name_(printable(file.filename().string())), options_(options) {
    extension_ = file.extension().string();
    std::transform(extension_.begin(), extension_.end(), extension_.begin(),
                   [](unsigned char c) { return std::tolower(c); });
  }

  ImportedFile run() {
    if (extension_ != ".obj" && extension_ != ".ply" && !is_gltf())
      fail("brume does not read meshes of type \"" + printable(extension_) + "\"",
           "export it as glTF, glb, OBJ or PLY");
    check_confined(file_, options_.confine);
    std::string bytes = read_regular_file(file_, kMaxFileBytes);
    if (is_gltf()) {
      emission_strengths_ = read_gltf_nodes(bytes, name_, out_);
      for (const auto& [name, strength] : emission_strengths_) defined_materials_.insert(name);
    }

    Assimp::Importer importer;
    auto* files = new FileSystem(options_, file_, std::move(bytes));  // Owned by the importer.
    importer.SetIOHandler(files);
    // Unprocessed first: what the importer hands over is checked before any of its steps touches
    // it.
    if (!importer.ReadFile(file_.string(), 0)) fail_import(importer, *files);
    check(*importer.GetScene());
    if (!importer.ApplyPostProcessing(aiProcess_Triangulate)) fail_import(importer, *files);
    // Those after the first are the importer's guesses at where the same library may lie.
    if (!files->refusals().empty())
      out_.warnings.push_back(name_ + ": " + files->refusals().front());
    if (!is_gltf()) defined_materials_ = files->defined_materials();
    convert(*importer.GetScene());
    return std::move(out_);
  }

 private:
  bool is_gltf() const { return extension_ == ".gltf" || extension_ == ".glb"; }

  [[noreturn]] void fail(const std::string& what, const std::string& what_to_do) const {
    throw Error(ErrorKind::InvalidInput,
                printable(file_.string()) + ": " + what + ": " + what_to_do);
  }
  [[noreturn]] void fail_import(const Assimp::Importer& importer, const FileSystem& files) const {
    const std::string reason =
        files.refusals().empty() ? importer.GetErrorString() : files.refusals().front();
    fail("the file is damaged or is not what its name says (" + printable(reason) + ")",
         "export it again");
  }
  void warn(const std::string& what) { out_.warnings.push_back(name_ + ": " + what); }

  void check(const aiScene& scene) {
    std::uint64_t triangles = 0;
    for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
      const aiMesh& mesh = *scene.mMeshes[m];
      if (mesh.mNumVertices > 0 && !mesh.mVertices)
        fail("a mesh has no positions", "export it again");
      if (mesh.mMaterialIndex >= scene.mNumMaterials)
        fail("a mesh names a material that is not there", "export it again");
      for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
        const aiFace& face = mesh.mFaces[f];
        for (unsigned i = 0; i < face.mNumIndices; ++i)
          if (face.mIndices[i] >= mesh.mNumVertices)
            fail("face " + std::to_string(f) + " names point " + std::to_string(face.mIndices[i]) +
                     " of " + std::to_string(mesh.mNumVertices),
                 "export it again");
        if (face.mNumIndices >= 3)
          triangles += face.mNumIndices - 2;
        else
          ++lines_and_points_;
      }
    }
    check_count(triangles);
    if (lines_and_points_ > 0)
      warn(std::to_string(lines_and_points_) + " points and lines are dropped");
  }

  void check_count(std::uint64_t triangles) const {
    if (triangles > options_.max_triangles)
      fail("more than " + std::to_string(options_.max_triangles) + " triangles",
           "simplify it, or raise --max-triangles");
  }

  void convert(const aiScene& scene) {
    for (unsigned i = 0; i < scene.mNumMaterials; ++i) add_material(*scene.mMaterials[i]);
    if (metals_ > 0)
      warn(std::to_string(metals_) +
           " metallic materials become glossy: specular = metalness x base colour");
    say_dropped(textures_, "textured", "their images are dropped, the plain colour stays");
    say_dropped(highlights_, "shiny", "their highlights (Ks) are dropped");
    say_dropped(transparents_, "transparent", "they become opaque");
    say_dropped(out_of_range_, "unphysical", "their colours are clamped");
    // A library may define names that no face uses; a scene may map them all the same.
    for (const std::string& name : defined_materials_)
      if (std::none_of(out_.materials.begin(), out_.materials.end(),
                       [&](const ImportedMaterial& m) { return m.material.name == name; }))
        out_.materials.push_back({.material = {.name = name}});

    out_.meshes.resize(2);
    if (scene.mRootNode) add_node(scene, *scene.mRootNode, Affine3d{}, 0);
    for (TriangleMesh& mesh : out_.meshes) {
      mesh.name = name_;
      const std::size_t bad = remove_bad_triangles(mesh);
      if (bad > 0)
        warn(std::to_string(bad) + " triangles without area or with bad corners are dropped");
      repair_normals(mesh);
      for (const std::uint32_t m : mesh.materials) ++out_.materials[m].triangle_count;
    }
    std::erase_if(out_.meshes, [](const TriangleMesh& mesh) { return mesh.triangles.empty(); });
    if (out_.meshes.empty() && out_.cameras.empty() && out_.lights.empty())
      warn("holds no triangles");
  }

  void say_dropped(const std::vector<std::string>& names, const char* kind, const char* what) {
    if (names.empty()) return;
    std::string list;
    for (std::size_t i = 0; i < std::min<std::size_t>(names.size(), 3); ++i)
      list += (i ? ", " : "") + printable(names[i], 60);
    if (names.size() > 3) list += " and " + std::to_string(names.size() - 3) + " more";
    warn(std::string(kind) + " materials (" + list + "): " + what);
  }

  static Rgb color(const aiMaterial& source, const char* key, unsigned type, unsigned index,
                   const Rgb& fallback) {
    aiColor4D c;
    if (source.Get(key, type, index, c) != aiReturn_SUCCESS) return fallback;
    return {c.r, c.g, c.b};
  }
  static float number(const aiMaterial& source, const char* key, unsigned type, unsigned index,
                      float fallback) {
    float x = 0;
    return source.Get(key, type, index, x) == aiReturn_SUCCESS ? x : fallback;
  }
  // Returns whether anything was out of range.
  static bool clamp(Rgb& c, float max) {
    const Rgb before = c;
    for (int i = 0; i < 3; ++i) c[i] = std::isfinite(c[i]) ? std::clamp(c[i], 0.0f, max) : 0.0f;
    return !(before == c);
  }

  void add_material(const aiMaterial& source) {
    aiString text;
    source.Get(AI_MATKEY_NAME, text);
    ImportedMaterial imported;
    Material& m = imported.material;
    m.name = text.C_Str();
    const bool is_nameless = m.name.empty() || m.name == kNoMaterial;
    imported.is_defined =
        is_gltf() ? !m.name.empty()
                  : !is_nameless && (extension_ != ".obj" || defined_materials_.contains(m.name));
    if (is_nameless && !imported.is_defined) m.name.clear();
    m.albedo = kDefaultGrey;
    if (imported.is_defined) read_material(source, m);
    out_.materials.push_back(std::move(imported));
  }

  void read_material(const aiMaterial& source, Material& m) {
    m.albedo = color(source, AI_MATKEY_COLOR_DIFFUSE, kDefaultGrey);
    m.emission = color(source, AI_MATKEY_COLOR_EMISSIVE, Rgb(0.0f));
    float opacity = number(source, AI_MATKEY_OPACITY, 1);
    if (is_gltf()) {
      aiColor4D base(1, 1, 1, 1);
      source.Get(AI_MATKEY_BASE_COLOR, base);
      m.albedo = {base.r, base.g, base.b};
      aiString alpha_mode;
      source.Get(AI_MATKEY_GLTF_ALPHAMODE, alpha_mode);
      opacity = alpha_mode == aiString("OPAQUE") || alpha_mode.length == 0 ? 1 : base.a;
      if (const auto it = emission_strengths_.find(m.name); it != emission_strengths_.end())
        m.emission *= float(it->second);
      int two_sided = 0;
      source.Get(AI_MATKEY_TWOSIDED, two_sided);
      m.two_sided = two_sided != 0;
    } else if (!is_black(color(source, AI_MATKEY_COLOR_SPECULAR, Rgb(0.0f))) &&
               extension_ == ".obj") {
      highlights_.push_back(m.name);
    }
    const bool albedo_clamped = clamp(m.albedo, 1), emission_clamped = clamp(m.emission, 1e30f);
    if (albedo_clamped || emission_clamped) out_of_range_.push_back(m.name);
    if (is_gltf()) {
      const float metallic = number(source, AI_MATKEY_METALLIC_FACTOR, 1);
      const float metal = std::isfinite(metallic) ? std::clamp(metallic, 0.0f, 1.0f) : 0.0f;
      if (metal > 0) {
        // The conductor's reflectance is its base colour; what is not metal stays diffuse.
        const float roughness = number(source, AI_MATKEY_ROUGHNESS_FACTOR, 1);
        m.specular = m.albedo * metal;
        m.albedo *= 1 - metal;
        m.roughness = std::isfinite(roughness) ? std::clamp(roughness, 0.05f, 1.0f) : 1.0f;
        ++metals_;
      }
    }
    if (!(opacity >= 1)) transparents_.push_back(m.name);
    for (const aiTextureType type :
         {aiTextureType_DIFFUSE, aiTextureType_BASE_COLOR, aiTextureType_EMISSIVE})
      if (source.GetTextureCount(type) > 0) {
        textures_.push_back(m.name);
        break;
      }
  }

  void add_node(const aiScene& scene, const aiNode& node, const Affine3d& parent, int depth) {
    if (depth > kMaxNodeDepth) fail("nodes are nested too deeply", "export it again");
    const Affine3d to_file = parent * affine(node.mTransformation);
    for (unsigned i = 0; i < node.mNumMeshes; ++i) {
      if (node.mMeshes[i] >= scene.mNumMeshes) fail("a node names no mesh", "export it again");
      add_mesh(*scene.mMeshes[node.mMeshes[i]], to_file, node);
    }
    for (unsigned i = 0; i < node.mNumChildren; ++i)
      add_node(scene, *node.mChildren[i], to_file, depth + 1);
  }

  void add_mesh(const aiMesh& source, const Affine3d& to_file, const aiNode& node) {
    if (source.mNumFaces == 0) return;
    if (!to_file.inverse()) {
      warn("node " + printable(node.mName.C_Str()) + " is scaled to nothing and is dropped");
      return;
    }
    const bool has_normals = source.HasNormals();
    TriangleMesh part;
    part.positions.reserve(source.mNumVertices);
    for (unsigned i = 0; i < source.mNumVertices; ++i)
      part.positions.emplace_back(source.mVertices[i].x, source.mVertices[i].y,
                                  source.mVertices[i].z);
    if (has_normals)
      for (unsigned i = 0; i < source.mNumVertices; ++i) {
        const aiVector3D& n = source.mNormals[i];
        part.normals.push_back(is_finite(n) ? Vec3f(n.x, n.y, n.z) : Vec3f(0.0f));
      }
    for (unsigned f = 0; f < source.mNumFaces; ++f) {
      const aiFace& face = source.mFaces[f];
      if (face.mNumIndices != 3) continue;
      part.triangles.push_back({face.mIndices[0], face.mIndices[1], face.mIndices[2]});
    }
    transform_mesh(part, to_file);

    TriangleMesh& whole = out_.meshes[has_normals ? 0 : 1];
    triangle_count_ += part.triangles.size();
    check_count(triangle_count_);  // Instances multiply what the file holds.
    const std::size_t base = whole.positions.size();
    if (base + part.positions.size() > std::numeric_limits<std::uint32_t>::max())
      fail("more points than 32 bits count", "split the file");
    whole.positions.insert(whole.positions.end(), part.positions.begin(), part.positions.end());
    whole.normals.insert(whole.normals.end(), part.normals.begin(), part.normals.end());
    for (const auto& t : part.triangles)
      whole.triangles.push_back(
          {std::uint32_t(base + t[0]), std::uint32_t(base + t[1]), std::uint32_t(base + t[2])});
    whole.materials.resize(whole.triangles.size(), source.mMaterialIndex);
  }

  // A zero or non-finite normal would give no direction to interpolate: the face's own serves.
  void repair_normals(TriangleMesh& mesh) {
    if (mesh.normals.empty()) return;
    std::size_t bad = 0;
    for (const auto& t : mesh.triangles)
      for (const std::uint32_t i : t) {
        if (mesh.normals[i].length() > 0) continue;
        const Vec3d n = (mesh.positions[t[1]] - mesh.positions[t[0]])
                            .cross(mesh.positions[t[2]] - mesh.positions[t[0]])
                            .normalized();
        mesh.normals[i] = Vec3f(n);
        ++bad;
      }
    if (bad > 0) warn(std::to_string(bad) + " normals without a direction are replaced");
  }

  const std::filesystem::path& file_;
  std::string name_, extension_;
  const MeshImportOptions& options_;
  ImportedFile out_;
  std::set<std::string> defined_materials_;
  std::map<std::string, double> emission_strengths_;  // glTF only.
  std::uint64_t triangle_count_ = 0, lines_and_points_ = 0;
  std::size_t metals_ = 0;
  std::vector<std::string> textures_, highlights_, transparents_, out_of_range_;
};

}  // namespace

ImportedFile import_mesh_file(const std::filesystem::path& file, const MeshImportOptions& options) {
  return Importer(file, options).run();
}

void transform_mesh(TriangleMesh& mesh, const Affine3d& m) {
  if (m == Affine3d{}) return;
  for (Vec3d& p : mesh.positions) p = m.point(p);
  if (m.determinant() < 0)
    for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
  if (mesh.normals.empty()) return;
  // Normals go by the inverse transpose.
  const Affine3d inverse = *m.inverse();
  for (Vec3f& n : mesh.normals) {
    const Vec3d moved = inverse.transposed_vector(Vec3d(n));
    const double length = moved.length();
    n = length > 0 && std::isfinite(length) ? Vec3f(moved / length) : Vec3f(0.0f);
  }
}

}  // namespace brume
