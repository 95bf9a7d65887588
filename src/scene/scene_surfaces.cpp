#include <algorithm>
#include <map>

#include "scene/json_text.h"
#include "scene/mesh_import.h"
#include "scene/scene_load.h"

namespace brume {
namespace {

Material read_material(const std::string& name, const ObjectView& view) {
  Material m;
  m.name = name;
  m.albedo = view.color("albedo");
  if (view.text("type") == "glossy") {
    m.specular = view.color("specular");
    m.roughness = float(view.number("roughness"));
  }
  m.emission = view.color("emission");
  m.direct = view.boolean("direct");
  m.two_sided = view.boolean("two_sided");
  return m;
}

class SurfaceLoader {
 public:
  explicit SurfaceLoader(SceneLoad& load) : load_(load), scene_(load.scene) {}

  void materials(const ObjectView& root) {
    for (const auto& [name, view] : root.object_map("materials")) {
      const Material m = read_material(name, view);
      if (max_component(m.albedo + m.specular) > 1.0f + 1e-6f)
        scene_.warnings.push_back(load_.document.file() + ": " + view.pointer() +
                                  ": albedo and specular sum to more than 1: the surface may "
                                  "reflect more than it receives");
      names_.emplace(name, std::uint32_t(scene_.materials.size()));
      scene_.materials.push_back(m);
    }
  }

  void mesh(const ObjectView& view) {
    const auto path = resolve_input(load_, view, "file");
    std::optional<std::uint32_t> whole;
    if (view.has("material"))
      whole = material_index(view.pointer("material"), view.text("material"));
    std::map<std::string, std::uint32_t> mapped;
    for (const auto& [in_file, name] : view.text_map("materials"))
      mapped[in_file] = material_index(child(view.pointer("materials"), in_file), name);
    if (!load_.options.load_data) return;

    const ImportedFile& imported = import(view.pointer("file"), path);
    std::vector<std::string> known;
    for (const ImportedMaterial& m : imported.materials)
      if (!m.material.name.empty()) known.push_back(m.material.name);
    for (const auto& [in_file, unused] : mapped)
      if (std::find(known.begin(), known.end(), in_file) == known.end())
        load_.document.fail(
            child(view.pointer("materials"), in_file), "the file has no material of this name",
            known.empty() ? "it names none; use \"material\"" : name_hint(in_file, known));
    if (!imported.cameras.empty() || !imported.lights.empty())
      scene_.warnings.push_back(load_.document.file() + ": " + view.pointer("file") +
                                ": cameras and lights of the file are dropped: name it under "
                                "\"include\" to take them");
    add(imported, path, whole, mapped, view.boolean("casts_shadow"), view.transform("transform"));
  }

  void include(const std::string& pointer, const std::string& text) {
    const auto path = resolve_path(load_, pointer, text, true);
    if (!load_.options.load_data) return;
    const ImportedFile& imported = import(pointer, path);
    add(imported, path, std::nullopt, {}, true, Affine3d{});
    for (const auto& [name, camera] : imported.cameras)
      if (!scene_.cameras.emplace(name, camera).second)
        scene_.warnings.push_back(load_.document.file() + ": " + pointer + ": camera " +
                                  printable(name) + " is dropped, there is one of that name");
    scene_.lights.insert(scene_.lights.end(), imported.lights.begin(), imported.lights.end());
  }

 private:
  static std::string child(const std::string& pointer, const std::string& key) {
    return child_pointer(pointer, key);
  }

  std::uint32_t material_index(const std::string& pointer, const std::string& name) const {
    if (const auto it = names_.find(name); it != names_.end()) return it->second;
    std::vector<std::string> known;
    for (const auto& [k, unused] : names_) known.push_back(k);
    load_.document.fail(pointer, "no material is named \"" + printable(name) + "\"",
                        known.empty() ? "add it to /materials" : name_hint(name, known));
  }

  const ImportedFile& import(const std::string& pointer, const std::filesystem::path& path) {
    if (const auto it = imported_.find(path); it != imported_.end()) return it->second;
    const MeshImportOptions options{load_.options.confine, load_.options.max_triangles};
    ImportedFile imported =
        at_place(load_.document, pointer, [&] { return import_mesh_file(path, options); });
    for (const std::string& w : imported.warnings)
      scene_.warnings.push_back(load_.document.file() + ": " + pointer + ": " + w);
    return imported_.emplace(path, std::move(imported)).first->second;
  }

  // The file's own material, or grey where it has none; each is added to the scene once.
  std::uint32_t own_material(const ImportedMaterial& m, const std::filesystem::path& path) {
    const std::string name =
        path.filename().string() + ":" + (m.material.name.empty() ? "default" : m.material.name);
    const auto [it, is_new] =
        own_.try_emplace({path, name}, std::uint32_t(scene_.materials.size()));
    if (is_new) {
      scene_.materials.push_back(m.material);
      scene_.materials.back().name = name;
      if (!m.is_defined)
        scene_.warnings.push_back(
            load_.document.file() + ": " + printable(path.filename().string()) + ": " +
            std::to_string(m.triangle_count) + " triangles " +
            (m.material.name.empty()
                 ? std::string("without a material")
                 : "of material \"" + printable(m.material.name) + "\", which nothing defines,") +
            " become grey (albedo 0.5): give the mesh \"material\" or \"materials\"");
    }
    return it->second;
  }

  void add(const ImportedFile& imported, const std::filesystem::path& path,
           std::optional<std::uint32_t> whole, const std::map<std::string, std::uint32_t>& mapped,
           bool casts_shadow, const Affine3d& transform) {
    std::vector<std::uint32_t> scene_material(imported.materials.size());
    for (std::size_t i = 0; i < imported.materials.size(); ++i) {
      const ImportedMaterial& m = imported.materials[i];
      const auto it = mapped.find(m.material.name);
      if (whole)
        scene_material[i] = *whole;
      else if (it != mapped.end() && !m.material.name.empty())
        scene_material[i] = it->second;
      else if (m.triangle_count > 0)
        scene_material[i] = own_material(m, path);
    }
    for (const TriangleMesh& source : imported.meshes) {
      triangles_ += source.triangles.size();
      if (triangles_ > load_.options.max_triangles)
        throw Error(ErrorKind::InvalidInput,
                    load_.document.file() + ": /meshes: more than " +
                        std::to_string(load_.options.max_triangles) +
                        " triangles together: simplify, or raise --max-triangles");
      TriangleMesh mesh = source;
      for (std::uint32_t& m : mesh.materials) m = scene_material[m];
      mesh.casts_shadow = casts_shadow;
      transform_mesh(mesh, transform);
      // A transform can flatten what was fine in the file.
      if (const std::size_t bad = remove_bad_triangles(mesh); bad > 0)
        scene_.warnings.push_back(load_.document.file() + ": " + mesh.name + ": " +
                                  std::to_string(bad) + " triangles vanish by the transform");
      scene_.meshes.push_back(std::move(mesh));
    }
  }

  SceneLoad& load_;
  Scene& scene_;
  std::map<std::string, std::uint32_t> names_;
  std::map<std::filesystem::path, ImportedFile> imported_;
  std::map<std::pair<std::filesystem::path, std::string>, std::uint32_t> own_;
  std::uint64_t triangles_ = 0;
};

}  // namespace

void load_surfaces(SceneLoad& load, const ObjectView& root) {
  SurfaceLoader loader(load);
  loader.materials(root);
  for (const ObjectView& view : root.objects("meshes")) loader.mesh(view);
  const auto includes = root.texts("include");
  for (std::size_t i = 0; i < includes.size(); ++i)
    loader.include(child_pointer(root.pointer("include"), i), includes[i]);
}

}  // namespace brume
