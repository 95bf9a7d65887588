# Installs the programs, the libraries and what find_package(brume) needs. Included last, when every
# library and program is known.
include(CMakePackageConfigHelpers)

get_property(_libraries GLOBAL PROPERTY BRUME_LIBRARIES)
get_property(_programs GLOBAL PROPERTY BRUME_PROGRAMS)

# brume::brume is all of them; each is there by itself too, as brume::core, brume::vdb_media ...
add_library(brume_everything INTERFACE)
target_link_libraries(brume_everything INTERFACE ${_libraries})
set_target_properties(brume_everything PROPERTIES EXPORT_NAME brume)
add_library(brume::brume ALIAS brume_everything)
foreach(_library IN LISTS _libraries)
  string(REGEX REPLACE "^brume_" "" _export_name ${_library})
  set_target_properties(${_library} PROPERTIES EXPORT_NAME ${_export_name})
endforeach()

set(_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/brume)
install(TARGETS ${_programs} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(TARGETS ${_libraries} brume_everything EXPORT brumeTargets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
        FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/brume)
install(EXPORT brumeTargets NAMESPACE brume:: DESTINATION ${_package_dir})

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/brumeConfig.cmake.in
                              ${PROJECT_BINARY_DIR}/brumeConfig.cmake
                              INSTALL_DESTINATION ${_package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/brumeConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/brumeConfig.cmake
              ${PROJECT_BINARY_DIR}/brumeConfigVersion.cmake
              ${CMAKE_CURRENT_LIST_DIR}/BrumePackages.cmake
        DESTINATION ${_package_dir})
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE ${PROJECT_SOURCE_DIR}/README.md
              ${PROJECT_SOURCE_DIR}/CHANGELOG.md
        DESTINATION ${CMAKE_INSTALL_DOCDIR})
