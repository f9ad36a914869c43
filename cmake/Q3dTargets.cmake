# The shared compile options, the precompiled headers and the helpers that declare our targets.

add_library(q3d_options INTERFACE)
target_compile_options(q3d_options INTERFACE -Wall -Wextra -Wpedantic -Wshadow -fPIC
                       $<$<BOOL:${Q3D_WERROR}>:-Werror>)
# GCC 12's straight-line vectoriser drops a rounding: of two neighbouring double -> float -> double conversions it
# keeps neither. Crops that are to equal the official code's bit for bit then differ.
target_compile_options(q3d_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-fno-tree-slp-vectorize>)
target_link_libraries(q3d_options INTERFACE fmt::fmt)

# LibTorch for our sources. Its wheel ships the headers of another version of fmt without that version's library, so a
# folder that holds Debian's headers comes before them.
if(Q3D_LIBTORCH)
  find_path(Q3D_FMT_INCLUDE_DIR fmt/format.h REQUIRED)
  file(MAKE_DIRECTORY "${PROJECT_BINARY_DIR}/include/fmt_first")
  file(CREATE_LINK "${Q3D_FMT_INCLUDE_DIR}/fmt" "${PROJECT_BINARY_DIR}/include/fmt_first/fmt" SYMBOLIC)
  add_library(q3d_torch INTERFACE)
  target_include_directories(q3d_torch SYSTEM BEFORE INTERFACE "${PROJECT_BINARY_DIR}/include/fmt_first")
  target_link_libraries(q3d_torch INTERFACE LibTorch::LibTorch)
endif()

# q3d_precompiled_header(NAME LIBS libs HEADERS headers): the library NAME carries a precompiled header, which targets
# with the same options reuse by REUSE_FROM.
function(q3d_precompiled_header name)
  cmake_parse_arguments(ARG "" "" "LIBS;HEADERS" ${ARGN})
  add_library(${name} STATIC "${PROJECT_SOURCE_DIR}/cmake/precompiled_header.cpp")
  target_link_libraries(${name} PUBLIC q3d_options nlohmann_json::nlohmann_json ${ARG_LIBS})
  target_precompile_headers(${name} PUBLIC ${ARG_HEADERS})
endfunction()

set(Q3D_STANDARD_HEADERS
  <fmt/format.h> <nlohmann/json.hpp> <algorithm> <array> <cmath> <cstdint> <filesystem> <functional> <map> <memory>
  <optional> <span> <stdexcept> <string> <string_view> <vector>)
# <torch/types.h> has the tensors. <torch/torch.h> has all modules too, which every source would instantiate again:
# that takes three times as long.
set(Q3D_TORCH_HEADERS <torch/types.h>)
q3d_precompiled_header(q3d_plain_pch HEADERS ${Q3D_STANDARD_HEADERS})
if(Q3D_LIBTORCH)
  q3d_precompiled_header(q3d_torch_pch LIBS q3d_torch HEADERS ${Q3D_TORCH_HEADERS} ${Q3D_STANDARD_HEADERS})
endif()

# q3d_precompiled(TARGET TORCH_OR_EMPTY): the precompiled header that suits the target.
function(q3d_precompiled target torch)
  if(torch)
    target_precompile_headers(${target} REUSE_FROM q3d_torch_pch)
  else()
    target_precompile_headers(${target} REUSE_FROM q3d_plain_pch)
  endif()
endfunction()

# q3d_include_root(TARGET SCOPE [headers...]): makes the headers of this folder, or those named, includable by their
# path in the repository for whoever links TARGET, and for nobody else. The root holds one link a header, so that an
# include without a link does not compile.
function(q3d_include_root target scope)
  set(root "${PROJECT_BINARY_DIR}/include/${target}")
  set(headers ${ARGN})
  if(NOT headers)
    file(GLOB headers CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/*.h")
  endif()
  foreach(header ${headers})
    file(RELATIVE_PATH path "${PROJECT_SOURCE_DIR}" "${header}")
    get_filename_component(folder "${root}/${path}" DIRECTORY)
    file(MAKE_DIRECTORY "${folder}")
    file(CREATE_LINK "${header}" "${root}/${path}" SYMBOLIC)
  endforeach()
  target_include_directories(${target} ${scope} "$<BUILD_INTERFACE:${root}>")
endfunction()

# tools/check_rooms.py reads this file. Each room adds a line.
file(WRITE "${PROJECT_BINARY_DIR}/rooms.tsv" "")

# q3d_room(JOB text [SOURCES ...] [PUBLIC libs] [PRIVATE libs] [TORCH] [PLAIN sources] [INSTALL])
# The room of this folder: one folder, one namespace, one static target, one include root. The target's name is the
# folder's path: pipeline/unit is q3d_pipeline_unit. TORCH adds LibTorch and its precompiled header; the sources after
# PLAIN include nothing of LibTorch and have the plain one, which makes them quicker to compile. INSTALL makes it a
# part of the CMake package (cmake/Q3dInstall.cmake).
function(q3d_room)
  cmake_parse_arguments(ARG "TORCH;INSTALL" "JOB" "SOURCES;PLAIN;PUBLIC;PRIVATE" ${ARGN})
  file(RELATIVE_PATH folder "${PROJECT_SOURCE_DIR}" "${CMAKE_CURRENT_SOURCE_DIR}")
  string(REPLACE "/" "_" name "q3d_${folder}")
  add_library(${name} STATIC ${ARG_SOURCES})
  q3d_include_root(${name} PUBLIC)
  target_compile_features(${name} PUBLIC cxx_std_20)
  target_link_libraries(${name} PUBLIC ${ARG_PUBLIC}
                        PRIVATE "$<BUILD_INTERFACE:q3d_options>" fmt::fmt ${ARG_PRIVATE})
  q3d_precompiled(${name} "${ARG_TORCH}")
  if(ARG_TORCH)
    target_link_libraries(${name} PUBLIC q3d_torch)
  endif()
  if(ARG_PLAIN)
    add_library(${name}_plain OBJECT ${ARG_PLAIN})
    q3d_include_root(${name}_plain PRIVATE)
    target_link_libraries(${name}_plain PRIVATE q3d_options ${ARG_PUBLIC} ${ARG_PRIVATE})
    q3d_precompiled(${name}_plain "")
    target_sources(${name} PRIVATE $<TARGET_OBJECTS:${name}_plain>)
  endif()
  if(ARG_INSTALL)
    q3d_install_room(${name} ${folder})
  endif()
  set(rooms ${ARG_PUBLIC} ${ARG_PRIVATE})
  list(FILTER rooms INCLUDE REGEX "^q3d_")
  list(TRANSFORM rooms REPLACE "^q3d_" "")
  string(REPLACE ";" " " rooms "${rooms}")
  file(APPEND "${PROJECT_BINARY_DIR}/rooms.tsv" "${folder}\t${rooms}\t${ARG_TORCH}\t${ARG_JOB}\n")
endfunction()

# Seconds after which a test counts as hung. Sanitizers make some tests ten times slower.
set(Q3D_TEST_TIMEOUT 3600)

# q3d_test(NAME SOURCES ... LIBS ... [LABEL label] [TORCH]): one GoogleTest binary. Each of its test cases is a ctest
# entry, NAME.Suite.Case. A binary that loads LibTorch takes half a second to start, so with TORCH each suite is an
# entry instead, NAME.Suite.
include(GoogleTest)
function(q3d_test name)
  cmake_parse_arguments(ARG "TORCH" "LABEL" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE q3d_options q3d_test_support ${ARG_LIBS} GTest::gtest_main)
  target_link_libraries(${name} PRIVATE q3d_test_options)
  if(ARG_TORCH)
    target_precompile_headers(${name} REUSE_FROM q3d_torch_test_pch)
  else()
    target_precompile_headers(${name} REUSE_FROM q3d_test_pch)
  endif()
  if(NOT ARG_LABEL)
    set(ARG_LABEL unit)
  endif()
  if(ARG_TORCH)
    target_link_libraries(${name} PRIVATE q3d_torch)
    q3d_discover_suites(${name} ${ARG_LABEL} ${Q3D_TEST_TIMEOUT})
  else()
    gtest_discover_tests(${name} TEST_PREFIX "${name}." DISCOVERY_TIMEOUT 120
                         PROPERTIES LABELS ${ARG_LABEL} TIMEOUT ${Q3D_TEST_TIMEOUT})
  endif()
endfunction()

# q3d_discover_suites(NAME LABEL TIMEOUT): does for suites what gtest_discover_tests does for cases. The binary is asked
# for its suites after it is linked, and ctest reads what was found.
function(q3d_discover_suites name label timeout)
  set(found "${CMAKE_CURRENT_BINARY_DIR}/${name}_suites.cmake")
  add_custom_command(TARGET ${name} POST_BUILD BYPRODUCTS "${found}"
    COMMAND ${CMAKE_COMMAND} -D "EXECUTABLE=$<TARGET_FILE:${name}>" -D NAME=${name} -D LABEL=${label}
            -D TIMEOUT=${timeout} -D "OUTPUT=${found}" -P "${PROJECT_SOURCE_DIR}/cmake/Q3dDiscoverSuites.cmake"
    VERBATIM)
  set(included "${CMAKE_CURRENT_BINARY_DIR}/${name}_include.cmake")
  file(WRITE "${included}" "if(EXISTS \"${found}\")\n  include(\"${found}\")\nelse()\n"
                           "  add_test(${name}_NOT_BUILT ${name}_NOT_BUILT)\nendif()\n")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES "${included}")
endfunction()
