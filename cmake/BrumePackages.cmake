# Every outside package brume uses, found in one place.
find_package(Imath 3 CONFIG REQUIRED)
find_package(TBB CONFIG REQUIRED)
find_package(nlohmann_json CONFIG REQUIRED)
find_package(assimp CONFIG REQUIRED)
find_package(OpenImageIO CONFIG REQUIRED)
find_package(CLI11 CONFIG REQUIRED)

# Debian ships OpenVDB with a find module beside the library rather than a config file.
find_path(BRUME_OPENVDB_CMAKE FindOpenVDB.cmake
          PATHS /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB /usr/lib/cmake/OpenVDB
          NO_DEFAULT_PATH)
if(BRUME_OPENVDB_CMAKE)
  list(APPEND CMAKE_MODULE_PATH ${BRUME_OPENVDB_CMAKE})
endif()
find_package(OpenVDB REQUIRED)

# Embree 4 where there is one (Ubuntu 24.04), else Embree 3 (Debian 12); geom/ hides which.
find_package(embree 4 CONFIG QUIET)
if(NOT embree_FOUND)
  find_package(embree 3 CONFIG REQUIRED)
endif()

find_path(XXHASH_INCLUDE_DIR xxhash.h REQUIRED)
find_package(Threads REQUIRED)
if(BRUME_BUILD_TESTS)
  find_package(GTest REQUIRED)
endif()
if(BRUME_BUILD_BENCHMARKS)
  find_package(benchmark REQUIRED)
endif()
