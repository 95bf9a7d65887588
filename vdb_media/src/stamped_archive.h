// Makes what OpenVDB writes depend on the grids alone. Private to vdb_media/, and knows no grids itself, so
// that no header of ours includes OpenVDB.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace brume {

// `write` writes a .vdb to the path it is given; that becomes `file`, aside, synced and renamed, with a
// hash for OpenVDB's random UUID. Throws Error(Resource) where it cannot write.
void write_stamped_archive(const std::filesystem::path& file,
                           const std::function<void(const std::string& path)>& write);

}  // namespace brume
