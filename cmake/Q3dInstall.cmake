# `cmake --install`, the CMake package and the .deb.
#
# PREFIX/bin/quadruped3d                 the program; it starts the next one
# PREFIX/libexec/quadruped3d             quadruped3d-network, which links LibTorch
# PREFIX/lib/quadruped3d/torch           LibTorch: a link to its folder, or a copy (see docs/install.md)
# PREFIX/lib, include/quadruped3d        the rooms that need no LibTorch, for other projects
# PREFIX/lib/cmake/quadruped3d           find_package(quadruped3d)
# PREFIX/share/quadruped3d               configs, the networks, licences, the bill of materials (SPDX)
# PREFIX/share/man, bash-completion, zsh/site-functions, fish/vendor_completions.d
#
# No file of it holds a path of the machine that built it.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# A program in the build folder looks for LibTorch where CMake found it. An installed program looks beside itself.
if(LIBTORCH_ROOT)
  set(CMAKE_BUILD_RPATH "${LIBTORCH_ROOT}/lib")
endif()

# q3d_install_room(TARGET FOLDER): the library and its headers; in the package as quadruped3d::FOLDER, with _ for /.
function(q3d_install_room target folder)
  string(REPLACE "/" "_" name "${folder}")
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  add_library(quadruped3d::${name} ALIAS ${target})
  target_include_directories(${target} PUBLIC "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/quadruped3d>")
  install(TARGETS ${target} EXPORT quadruped3dTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  file(GLOB headers CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/*.h")
  install(FILES ${headers} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/quadruped3d/${folder})
endfunction()

function(q3d_install_programs)
  set(libexec "${CMAKE_INSTALL_LIBEXECDIR}/quadruped3d")
  set_target_properties(quadruped3d-network PROPERTIES INSTALL_RPATH "$ORIGIN/../../lib/quadruped3d/torch/lib")
  install(DIRECTORY DESTINATION lib/quadruped3d)  # where LibTorch is linked
  install(TARGETS quadruped3d RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  install(TARGETS quadruped3d-network RUNTIME DESTINATION ${libexec})
  install(DIRECTORY configs models DESTINATION ${CMAKE_INSTALL_DATADIR}/quadruped3d)
  install(FILES LICENSE THIRD_PARTY_NOTICES.md CITATION.cff README.md
          DESTINATION ${CMAKE_INSTALL_DATADIR}/quadruped3d)
endfunction()

# What the program prints about its own commands is installed as a file: q3d_install_output(FOLDER FILE WORDS...).
# It is printed when the project is installed, because the program may be built later than CMake configures.
function(q3d_install_output folder file)
  set(made "${PROJECT_BINARY_DIR}/installed/${file}")
  string(JOIN " " words ${ARGN})
  install(CODE "
    file(MAKE_DIRECTORY \"${PROJECT_BINARY_DIR}/installed\")
    execute_process(COMMAND \"$<TARGET_FILE:quadruped3d>\" ${words} OUTPUT_FILE \"${made}\" COMMAND_ERROR_IS_FATAL ANY)
    file(INSTALL \"${made}\" DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${folder}\")")
endfunction()

function(q3d_install_completions)
  set(share "${CMAKE_INSTALL_DATADIR}")
  q3d_install_output("${share}/bash-completion/completions" quadruped3d completion bash)
  q3d_install_output("${share}/zsh/site-functions" _quadruped3d completion zsh)
  q3d_install_output("${share}/fish/vendor_completions.d" quadruped3d.fish completion fish)
  q3d_install_output("${CMAKE_INSTALL_MANDIR}/man1" quadruped3d.1 man)
endfunction()

# What the programs are made of and need, as SPDX; made when the project is installed, from what is installed then.
function(q3d_install_sbom)
  install(CODE "
    execute_process(COMMAND \"${Q3D_PIP_PYTHON}\" \"${PROJECT_SOURCE_DIR}/tools/make_sbom.py\"
      \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}\" --version ${PROJECT_VERSION} --plotly \"${Q3D_PLOTLY}\"
      --out \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATADIR}/quadruped3d/quadruped3d.spdx.json\"
      COMMAND_ERROR_IS_FATAL ANY)")
endfunction()

function(q3d_install_package)
  set(folder "${CMAKE_INSTALL_LIBDIR}/cmake/quadruped3d")
  install(EXPORT quadruped3dTargets NAMESPACE quadruped3d:: DESTINATION ${folder})
  configure_package_config_file(cmake/quadruped3dConfig.cmake.in "${PROJECT_BINARY_DIR}/quadruped3dConfig.cmake"
                                INSTALL_DESTINATION ${folder})
  write_basic_package_version_file("${PROJECT_BINARY_DIR}/quadruped3dConfigVersion.cmake"
                                   COMPATIBILITY SameMinorVersion)
  install(FILES "${PROJECT_BINARY_DIR}/quadruped3dConfig.cmake" "${PROJECT_BINARY_DIR}/quadruped3dConfigVersion.cmake"
                cmake/FindOpenCVMinimal.cmake
          DESTINATION ${folder})
  if(PROJECT_IS_TOP_LEVEL)
    q3d_install_programs()
    q3d_install_completions()
    include(Q3dPlotly)
    q3d_install_sbom()
    set(CPACK_GENERATOR DEB)
    set(CPACK_PACKAGE_CONTACT "the quadruped3d contributors")
    set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Builds 3D datasets of quadrupeds from photographs with 2D keypoints")
    set(CPACK_RESOURCE_FILE_LICENSE "${PROJECT_SOURCE_DIR}/LICENSE")
    set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
    set(CPACK_DEBIAN_PACKAGE_SECTION science)
    # The packages of the shared libraries; LibTorch, which is no Debian package, is found where it was linked from.
    set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
    if(LIBTORCH_ROOT)
      set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS "${LIBTORCH_ROOT}/lib")
    endif()
    include(CPack)
  endif()
endfunction()
