# brume_library(), brume_program(), brume_test(), brume_benchmark(): flags and layout in one place.
include(GoogleTest OPTIONAL)

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()
# Release keeps assertions out and vectorises; contraction stays off everywhere, so that every
# instruction set gives the same bits (docs/decisions).
set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG")

add_library(brume_flags INTERFACE)
target_compile_options(brume_flags INTERFACE
  -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Wformat=2 -Werror
  -ffp-contract=off -fno-math-errno -fstack-protector-strong
  -ffile-prefix-map=${PROJECT_SOURCE_DIR}=.
  # False alarms of GCC 12 on "literal" + std::string (its bug 105651).
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)
target_compile_definitions(brume_flags INTERFACE BRUME_VERSION="${PROJECT_VERSION}")

set(BRUME_SANITIZE "" CACHE STRING "Sanitizers for every target: address;undefined or thread")
if(BRUME_SANITIZE)
  string(REPLACE ";" "," _list "${BRUME_SANITIZE}")
  target_compile_options(brume_flags INTERFACE -fsanitize=${_list} -fno-sanitize-recover=all -g)
  target_link_options(brume_flags INTERFACE -fsanitize=${_list})
endif()

# brume_library(NAME SOURCES ... [HEADERS ...] [INCLUDE dir] [PUBLIC libs] [PRIVATE libs])
# HEADERS are installed; a header that only its own sources may read goes among SOURCES.
function(brume_library name)
  cmake_parse_arguments(A "" "INCLUDE" "SOURCES;HEADERS;PUBLIC;PRIVATE" ${ARGN})
  if(NOT A_INCLUDE)
    set(A_INCLUDE ${PROJECT_SOURCE_DIR}/src)
  endif()
  add_library(${name} STATIC ${A_SOURCES})
  target_sources(${name} PUBLIC FILE_SET HEADERS BASE_DIRS ${A_INCLUDE} FILES ${A_HEADERS})
  target_include_directories(${name} PUBLIC $<BUILD_INTERFACE:${A_INCLUDE}>)
  target_compile_features(${name} PUBLIC cxx_std_20)
  target_link_libraries(${name} PUBLIC ${A_PUBLIC} PRIVATE ${A_PRIVATE} $<BUILD_INTERFACE:brume_flags>)
  set_property(GLOBAL APPEND PROPERTY BRUME_LIBRARIES ${name})
endfunction()

# brume_program(NAME SOURCES ... LINK libs)
function(brume_program name)
  cmake_parse_arguments(A "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${A_SOURCES})
  target_link_libraries(${name} PRIVATE ${A_LINK} brume_flags)
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
  set_property(GLOBAL APPEND PROPERTY BRUME_PROGRAMS ${name})
endfunction()

# brume_test(NAME LABEL unit SOURCES ... LINK libs [TIMEOUT s]); its main() is tests/support's.
function(brume_test name)
  cmake_parse_arguments(A "" "LABEL;TIMEOUT" "SOURCES;LINK" ${ARGN})
  if(NOT A_TIMEOUT)
    set(A_TIMEOUT 600)
  endif()
  add_executable(${name} ${A_SOURCES})
  target_link_libraries(${name} PRIVATE ${A_LINK} brume_test_main GTest::gtest GTest::gmock brume_flags)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_compile_definitions(${name} PRIVATE
    BRUME_SHARED_DATA="${PROJECT_SOURCE_DIR}/../shared/data"
    BRUME_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
  gtest_discover_tests(${name} NO_PRETTY_VALUES PROPERTIES LABELS "${A_LABEL}" TIMEOUT ${A_TIMEOUT} DISCOVERY_TIMEOUT 60)
endfunction()

# brume_benchmark(NAME SOURCES ... LINK libs)
function(brume_benchmark name)
  cmake_parse_arguments(A "" "" "SOURCES;LINK" ${ARGN})
  if(NOT BRUME_BUILD_BENCHMARKS)
    return()
  endif()
  add_executable(${name} ${A_SOURCES})
  target_link_libraries(${name} PRIVATE ${A_LINK} benchmark::benchmark brume_flags)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_compile_definitions(${name} PRIVATE BRUME_SHARED_DATA="${PROJECT_SOURCE_DIR}/../shared/data")
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
endfunction()
