# Finds LibTorch inside a PyTorch wheel (or an unpacked libtorch) and makes the target LibTorch::LibTorch.
#
# The wheel's own TorchConfig.cmake demands a CUDA toolkit at build time. Nothing here needs one: the program
# uses CUDA only at run time, through LibTorch. Set LIBTORCH_ROOT to the folder that holds include/ and lib/.
if(NOT LIBTORCH_ROOT)
  file(GLOB _q3d_torch_candidates "${PROJECT_SOURCE_DIR}/.venv/lib/python3*/site-packages/torch")
  if(_q3d_torch_candidates)
    list(GET _q3d_torch_candidates 0 _q3d_torch_root)
    set(LIBTORCH_ROOT "${_q3d_torch_root}" CACHE PATH "Folder of LibTorch (include/ and lib/)" FORCE)
  endif()
endif()

find_path(LIBTORCH_INCLUDE_DIR torch/csrc/api/include/torch/torch.h
          HINTS "${LIBTORCH_ROOT}/include" NO_DEFAULT_PATH)
find_library(LIBTORCH_CPU_LIBRARY torch_cpu HINTS "${LIBTORCH_ROOT}/lib" NO_DEFAULT_PATH)
find_library(LIBTORCH_C10_LIBRARY c10 HINTS "${LIBTORCH_ROOT}/lib" NO_DEFAULT_PATH)
if(EXISTS "${LIBTORCH_ROOT}/version.py")
  file(STRINGS "${LIBTORCH_ROOT}/version.py" _q3d_torch_version REGEX "__version__ = ")
  string(REGEX MATCH "[0-9]+\\.[0-9]+\\.[0-9]+" LIBTORCH_VERSION "${_q3d_torch_version}")
elseif(EXISTS "${LIBTORCH_ROOT}/build-version")
  file(READ "${LIBTORCH_ROOT}/build-version" _q3d_torch_version)
  string(REGEX MATCH "[0-9]+\\.[0-9]+\\.[0-9]+" LIBTORCH_VERSION "${_q3d_torch_version}")
endif()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(LibTorch
  REQUIRED_VARS LIBTORCH_INCLUDE_DIR LIBTORCH_CPU_LIBRARY LIBTORCH_C10_LIBRARY
  VERSION_VAR LIBTORCH_VERSION
  REASON_FAILURE_MESSAGE "run `make setup`, or pass -DLIBTORCH_ROOT=<folder with include/ and lib/>")

if(LibTorch_FOUND AND NOT TARGET LibTorch::LibTorch)
  set(_q3d_torch_libs "")
  foreach(_lib torch torch_cpu torch_cuda c10 c10_cuda)
    if(EXISTS "${LIBTORCH_ROOT}/lib/lib${_lib}.so")
      list(APPEND _q3d_torch_libs "${LIBTORCH_ROOT}/lib/lib${_lib}.so")
    endif()
  endforeach()
  list(JOIN _q3d_torch_libs " " _q3d_torch_link)
  add_library(LibTorch::LibTorch INTERFACE IMPORTED)
  # Nothing in our objects names a symbol of torch_cuda, so the linker would drop it and no GPU would be found.
  # libstdc++ comes first: the wheel's libraries export their own, partly empty copies of std::filesystem, and
  # the first library that has a symbol wins (std::filesystem::remove_all would jump to address 0).
  set_target_properties(LibTorch::LibTorch PROPERTIES
    INTERFACE_INCLUDE_DIRECTORIES "${LIBTORCH_INCLUDE_DIR};${LIBTORCH_INCLUDE_DIR}/torch/csrc/api/include"
    INTERFACE_SYSTEM_INCLUDE_DIRECTORIES "${LIBTORCH_INCLUDE_DIR};${LIBTORCH_INCLUDE_DIR}/torch/csrc/api/include"
    INTERFACE_LINK_LIBRARIES "-Wl,--push-state,--no-as-needed -lstdc++ ${_q3d_torch_link} -Wl,--pop-state")
  unset(_q3d_torch_libs)
endif()

# The headers of NCCL and CUDA are in wheels that LibTorch's own depends on. LibTorch::Nccl has them if LibTorch was
# made with CUDA; NCCL itself is a part of what LibTorch links.
if(LibTorch_FOUND AND EXISTS "${LIBTORCH_ROOT}/lib/libtorch_cuda.so" AND NOT TARGET LibTorch::Nccl)
  find_path(LIBTORCH_NCCL_INCLUDE_DIR nccl.h HINTS "${LIBTORCH_ROOT}/../nvidia/nccl/include" NO_DEFAULT_PATH)
  file(GLOB _q3d_cuda_include "${LIBTORCH_ROOT}/../nvidia/cu*/include")
  find_path(LIBTORCH_CUDA_INCLUDE_DIR cuda_runtime_api.h HINTS ${_q3d_cuda_include} NO_DEFAULT_PATH)
  if(LIBTORCH_NCCL_INCLUDE_DIR AND LIBTORCH_CUDA_INCLUDE_DIR)
    add_library(LibTorch::Nccl INTERFACE IMPORTED)
    set_target_properties(LibTorch::Nccl PROPERTIES
      INTERFACE_COMPILE_DEFINITIONS Q3D_NCCL
      INTERFACE_INCLUDE_DIRECTORIES "${LIBTORCH_NCCL_INCLUDE_DIR};${LIBTORCH_CUDA_INCLUDE_DIR}"
      INTERFACE_SYSTEM_INCLUDE_DIRECTORIES "${LIBTORCH_NCCL_INCLUDE_DIR};${LIBTORCH_CUDA_INCLUDE_DIR}")
  endif()
endif()
