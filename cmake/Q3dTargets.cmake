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
target_include_directories(q3d_options INTERFACE "${CMAKE_SOURCE_DIR}")

# One precompiled <torch/torch.h> for every target that sees LibTorch: it turns 15 s a file into a few.
add_library(q3d_torch_pch STATIC "${CMAKE_SOURCE_DIR}/cmake/torch_pch.cpp")
target_link_libraries(q3d_torch_pch PUBLIC q3d_options LibTorch::LibTorch)
target_precompile_headers(q3d_torch_pch PUBLIC <torch/torch.h>)

# q3d_library(NAME SOURCES ... [PUBLIC libs] [PRIVATE libs] [TORCH])
# One folder, one static library. TORCH adds LibTorch and its precompiled header.
function(q3d_library name)
  cmake_parse_arguments(ARG "TORCH" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_link_libraries(${name} PUBLIC q3d_options ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  if(ARG_TORCH)
    target_link_libraries(${name} PUBLIC LibTorch::LibTorch)
    target_precompile_headers(${name} REUSE_FROM q3d_torch_pch)
  endif()
endfunction()

# q3d_test(NAME SOURCES ... LIBS ... [LABEL label] [TORCH]): one GoogleTest binary, one ctest entry a test case.
function(q3d_test name)
  cmake_parse_arguments(ARG "TORCH" "LABEL" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE q3d_options q3d_test_support ${ARG_LIBS} GTest::gtest_main)
  if(ARG_TORCH)
    target_link_libraries(${name} PRIVATE LibTorch::LibTorch)
    target_precompile_headers(${name} REUSE_FROM q3d_torch_pch)
  endif()
  if(NOT ARG_LABEL)
    set(ARG_LABEL unit)
  endif()
  add_test(NAME ${name} COMMAND ${name})
  set_tests_properties(${name} PROPERTIES LABELS "${ARG_LABEL}" TIMEOUT 600)
endfunction()
