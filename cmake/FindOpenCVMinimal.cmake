# Finds the three OpenCV modules that are used (core, imgproc, imgcodecs) and makes OpenCVMinimal::OpenCV.
#
# Debian's OpenCVConfig.cmake lives in libopencv-dev, which pulls in some 300 packages (VTK, Qt, ffmpeg); the small
# per-module packages have headers and libraries only. opencv_dnn must not be linked: its protobuf clashes with
# the one inside LibTorch.
find_path(OPENCV_INCLUDE_DIR opencv2/core.hpp PATH_SUFFIXES opencv4)
set(_q3d_opencv_vars OPENCV_INCLUDE_DIR)
foreach(_module core imgproc imgcodecs)
  string(TOUPPER ${_module} _upper)
  find_library(OPENCV_${_upper}_LIBRARY opencv_${_module})
  list(APPEND _q3d_opencv_vars OPENCV_${_upper}_LIBRARY)
endforeach()
if(OPENCV_INCLUDE_DIR)
  file(STRINGS "${OPENCV_INCLUDE_DIR}/opencv2/core/version.hpp" _q3d_opencv_version
       REGEX "#define CV_VERSION_(MAJOR|MINOR|REVISION) ")
  string(REGEX REPLACE "[^0-9;]*([0-9]+)[^;]*" "\\1" _q3d_opencv_version "${_q3d_opencv_version}")
  list(JOIN _q3d_opencv_version "." OpenCVMinimal_VERSION)
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(OpenCVMinimal REQUIRED_VARS ${_q3d_opencv_vars}
  VERSION_VAR OpenCVMinimal_VERSION
  REASON_FAILURE_MESSAGE "install libopencv-core-dev libopencv-imgproc-dev libopencv-imgcodecs-dev")

if(OpenCVMinimal_FOUND AND NOT TARGET OpenCVMinimal::OpenCV)
  add_library(OpenCVMinimal::OpenCV INTERFACE IMPORTED)
  set_target_properties(OpenCVMinimal::OpenCV PROPERTIES
    INTERFACE_INCLUDE_DIRECTORIES "${OPENCV_INCLUDE_DIR}"
    INTERFACE_SYSTEM_INCLUDE_DIRECTORIES "${OPENCV_INCLUDE_DIR}"
    INTERFACE_LINK_LIBRARIES "${OPENCV_IMGCODECS_LIBRARY};${OPENCV_IMGPROC_LIBRARY};${OPENCV_CORE_LIBRARY}")
endif()
