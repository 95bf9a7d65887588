// Writes grids as a .vdb file whose bytes depend on the grids alone. Private to vdb_media/.
#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>

#include "core/math.h"

namespace brume {

openvdb::math::Transform::Ptr to_transform(const Affine3d& index_to_world);

// Aside, synced, renamed. Throws Error(Resource) where it cannot write.
void write_archive(const std::filesystem::path& file, const openvdb::GridPtrVec& grids);

}  // namespace brume
