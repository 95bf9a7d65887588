# Every outside package brume uses, found in one place, both when it is built and by those who use
# the installed libraries: brumeConfig.cmake includes this file with brume_find() meaning
# find_dependency(), the build with find_package(... REQUIRED).
if(NOT COMMAND brume_find)
  macro(brume_find)
    find_package(${ARGV} REQUIRED)
  endmacro()
endif()

brume_find(Imath 3 CONFIG)
brume_find(TBB CONFIG)
brume_find(nlohmann_json CONFIG)
brume_find(assimp CONFIG)
brume_find(OpenImageIO CONFIG)
brume_find(CLI11 CONFIG)
brume_find(hwy CONFIG)
brume_find(Threads)

# Debian's OpenImageIO names OpenCV's headers, which none of its packages depends on and brume never
# includes. CMake refuses a target that names a folder which is not there.
get_target_property(_brume_dirs OpenImageIO::OpenImageIO INTERFACE_INCLUDE_DIRECTORIES)
set(_brume_present "")
foreach(_brume_dir IN LISTS _brume_dirs)
  if(IS_DIRECTORY ${_brume_dir})
    list(APPEND _brume_present ${_brume_dir})
  endif()
endforeach()
set_target_properties(OpenImageIO::OpenImageIO PROPERTIES
                      INTERFACE_INCLUDE_DIRECTORIES "${_brume_present}"
                      INTERFACE_SYSTEM_INCLUDE_DIRECTORIES "")

# Debian ships OpenVDB with a find module beside the library rather than a config file.
find_path(BRUME_OPENVDB_CMAKE FindOpenVDB.cmake
          PATHS /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/cmake/OpenVDB /usr/lib/cmake/OpenVDB
          NO_DEFAULT_PATH)
mark_as_advanced(BRUME_OPENVDB_CMAKE)
if(BRUME_OPENVDB_CMAKE)
  list(APPEND CMAKE_MODULE_PATH ${BRUME_OPENVDB_CMAKE})
endif()
brume_find(OpenVDB)

# Embree 4 where there is one (Ubuntu 24.04), else Embree 3 (Debian 12); geom/ hides which.
find_package(embree 4 CONFIG QUIET)
if(NOT embree_FOUND)
  brume_find(embree 3 CONFIG)
endif()
