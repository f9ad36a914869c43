# q3d_embed_topologies(SOURCE): writes a C++ source that holds the files of configs/topologies, so that a config can name
# them from any folder. CMake runs again when one of them changes.
function(q3d_embed_topologies source)
  file(GLOB files CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/configs/topologies/*.json")
  list(SORT files)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${files})
  list(LENGTH files count)
  set(entries "")
  foreach(file IN LISTS files)
    get_filename_component(name "${file}" NAME_WE)
    file(READ "${file}" text)
    string(APPEND entries "    {\"${name}\", R\"topology(${text})topology\"},\n")
  endforeach()
  file(CONFIGURE OUTPUT "${source}" @ONLY CONTENT [[
// Made by cmake/Q3dEmbedTopologies.cmake from configs/topologies.
#include "loaders/keypoints/builtin_topologies.h"

#include <array>

namespace q3d::loaders::keypoints {

std::span<const BuiltinTopology> builtin_topologies() {
  static constexpr std::array<BuiltinTopology, @count@> kTopologies{{
@entries@  }};
  return kTopologies;
}

}  // namespace q3d::loaders::keypoints
]])
endfunction()
