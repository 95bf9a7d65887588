// Cameras and punctual lights of a glTF file, and the names of what we do not read.
//
// Read from the file's JSON rather than through the mesh importer: releases of that library
// disagree on the field of view and lose all but one instance of a light.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "scene/mesh_import.h"

namespace brume {

// `bytes` is a .gltf or .glb file; adds to cameras, lights and warnings of `imported`. `name` is
// the file's, for messages. Returns all materials by name with the strength of their emission: the
// importer forgets those that no surface uses, and releases of it forget the strength. Throws
// Error(InvalidInput).
std::map<std::string, double> read_gltf_nodes(std::string_view bytes, const std::string& name,
                                              ImportedFile& imported);

}  // namespace brume
