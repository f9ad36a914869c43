# The shared compile options, the precompiled LibTorch header and the helpers that declare our targets.

# fmt is used header-only: LibTorch's wheel ships its own copy, which is found first in sources that include
# LibTorch. The two have different inline namespaces, so they never meet at link time as long as neither is
# linked as a library and no fmt type appears in a public header.
add_library(q3d_options INTERFACE)
target_compile_options(q3d_options INTERFACE -Wall -Wextra -Wpedantic -Wshadow -fPIC
                       $<$<BOOL:${Q3D_WERROR}>:-Werror>)
# GCC 12's straight-line vectoriser drops a rounding: of two neighbouring double -> float -> double conversions it
# keeps neither. Crops that are to equal the official code's bit for bit then differ.
target_compile_options(q3d_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-fno-tree-slp-vectorize>)
target_compile_definitions(q3d_options INTERFACE FMT_HEADER_ONLY=1)

# One precompiled <torch/torch.h> for every target that sees LibTorch: it turns 15 s a file into a few.
if(Q3D_LIBTORCH)
  add_library(q3d_torch_pch STATIC "${PROJECT_SOURCE_DIR}/cmake/torch_pch.cpp")
  target_link_libraries(q3d_torch_pch PUBLIC q3d_options LibTorch::LibTorch)
  target_precompile_headers(q3d_torch_pch PUBLIC <torch/torch.h>)
endif()

# The same for every other target: parsing nlohmann-json and fmt takes longer than most of our sources.
add_library(q3d_plain_pch STATIC "${PROJECT_SOURCE_DIR}/cmake/plain_pch.cpp")
target_link_libraries(q3d_plain_pch PUBLIC q3d_options nlohmann_json::nlohmann_json)
target_precompile_headers(q3d_plain_pch PUBLIC
  <fmt/format.h> <nlohmann/json.hpp> <algorithm> <array> <cmath> <cstdint> <filesystem> <functional> <map> <memory>
  <optional> <span> <stdexcept> <string> <string_view> <vector>)

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

# What tools/check_rooms.py reads: a line a room.
file(WRITE "${PROJECT_BINARY_DIR}/rooms.tsv" "")

# q3d_room(JOB text [SOURCES ...] [PUBLIC libs] [PRIVATE libs] [TORCH] [PLAIN sources] [INSTALL])
# The room of this folder: one folder, one namespace, one static target, one include root. The target's name is the
# folder's path: pipeline/unit is q3d_pipeline_unit. TORCH adds LibTorch and its precompiled header; the sources after
# PLAIN do without that header, which makes them quicker to compile. INSTALL makes it a
# part of the CMake package (cmake/Q3dInstall.cmake).
function(q3d_room)
  cmake_parse_arguments(ARG "TORCH;INSTALL" "JOB" "SOURCES;PLAIN;PUBLIC;PRIVATE" ${ARGN})
  file(RELATIVE_PATH folder "${PROJECT_SOURCE_DIR}" "${CMAKE_CURRENT_SOURCE_DIR}")
  string(REPLACE "/" "_" name "q3d_${folder}")
  add_library(${name} STATIC ${ARG_SOURCES} ${ARG_PLAIN})
  q3d_include_root(${name} PUBLIC)
  target_compile_features(${name} PUBLIC cxx_std_20)
  target_link_libraries(${name} PUBLIC ${ARG_PUBLIC} PRIVATE "$<BUILD_INTERFACE:q3d_options>" ${ARG_PRIVATE})
  q3d_precompiled(${name} "${ARG_TORCH}")
  if(ARG_TORCH)
    target_link_libraries(${name} PUBLIC LibTorch::LibTorch)
    set_source_files_properties(${ARG_PLAIN} PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
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

# q3d_test(NAME SOURCES ... LIBS ... [LABEL label] [TORCH]): one GoogleTest binary. Each of its test cases is a ctest
# entry, NAME.Suite.Case. A binary that loads LibTorch takes half a second to start, so with TORCH each suite is an
# entry instead, NAME.Suite.
include(GoogleTest)
function(q3d_test name)
  cmake_parse_arguments(ARG "TORCH" "LABEL" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE q3d_options q3d_test_support ${ARG_LIBS} GTest::gtest_main)
  q3d_precompiled(${name} "${ARG_TORCH}")
  if(NOT ARG_LABEL)
    set(ARG_LABEL unit)
  endif()
  if(ARG_TORCH)
    target_link_libraries(${name} PRIVATE LibTorch::LibTorch)
    q3d_discover_suites(${name} ${ARG_LABEL} 600)
  else()
    gtest_discover_tests(${name} TEST_PREFIX "${name}." DISCOVERY_TIMEOUT 120
                         PROPERTIES LABELS ${ARG_LABEL} TIMEOUT 600)
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
