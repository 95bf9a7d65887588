// Surfaces from files that other programs wrote: OBJ with MTL, PLY, glTF and glb.
//
// What is imported is in the file's own space with its node transforms applied; what is dropped is
// said in `warnings`. Nothing the file holds is trusted: indices, counts and numbers are checked
// here.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "geom/triangle_mesh.h"
#include "scene/light.h"
#include "scene/material.h"
#include "scene/scene.h"

namespace brume {

struct MeshImportOptions {
  std::optional<std::filesystem::path>
      confine;  // Also for what the file itself names (MTL, buffers).
  std::uint64_t max_triangles = 200'000'000;
};

struct ImportedMaterial {
  Material material;  // With the file's name for it; "" for surfaces that have none.
  // The file says what it is, rather than only naming it.
  bool is_defined = true;
  std::size_t triangle_count = 0;
};

struct ImportedFile {
  // At most two: faces with normals and faces without. TriangleMesh::materials index `materials`.
  std::vector<TriangleMesh> meshes;
  std::vector<ImportedMaterial> materials;
  std::vector<std::pair<std::string, Camera>> cameras;
  std::vector<LightDescription> lights;
  std::vector<std::string> warnings;  // Each begins with the file's name.
};

// Throws Error(InvalidInput) `FILE: what: what to do`.
ImportedFile import_mesh_file(const std::filesystem::path& file, const MeshImportOptions& options);

// Moves a mesh; mirroring maps keep the front where it was on the mirrored surface. `m` is
// invertible.
void transform_mesh(TriangleMesh& mesh, const Affine3d& m);

}  // namespace brume
