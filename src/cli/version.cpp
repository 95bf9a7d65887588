#include "cli/version.h"

#include <CLI/Version.hpp>
#include <nlohmann/json.hpp>

#include "geom/ray_tracer.h"

#define BRUME_TEXT_OF(x) #x
#define BRUME_TEXT(x) BRUME_TEXT_OF(x)

namespace brume {

std::string program_version() { return "brume " BRUME_VERSION; }

// Versions of libraries that this folder must not include come from the build (CMakeLists.txt).
std::string version_text() {
  return program_version() + "\n  OpenVDB " BRUME_OPENVDB_VERSION "\n  " +
         RayTracer::library_version() +
         "\n  OpenImageIO " BRUME_OPENIMAGEIO_VERSION "\n  OpenEXR " BRUME_OPENEXR_VERSION
         "\n  oneTBB " BRUME_TBB_VERSION "\n  assimp " BRUME_ASSIMP_VERSION
         "\n  CLI11 " CLI11_VERSION
         "\n  nlohmann json " BRUME_TEXT(NLOHMANN_JSON_VERSION_MAJOR) "." BRUME_TEXT(
             NLOHMANN_JSON_VERSION_MINOR) "." BRUME_TEXT(NLOHMANN_JSON_VERSION_PATCH) "\n";
}

}  // namespace brume
