# Q3D_PLOTLY: the path of plotly.min.js, which the report's pages carry. tools/fetch_plotly.py pins its version and its
# digest, and fetches it from PyPI once. It lies outside the build folders, so that they share it.
set(Q3D_PLOTLY "${PROJECT_SOURCE_DIR}/build/plotly/plotly.min.js")
find_program(Q3D_PIP_PYTHON python3 HINTS "${LIBTORCH_ROOT}/../../../../bin" NO_DEFAULT_PATH REQUIRED)
execute_process(COMMAND ${Q3D_PIP_PYTHON} "${PROJECT_SOURCE_DIR}/tools/fetch_plotly.py" "${Q3D_PLOTLY}"
                RESULT_VARIABLE fetched)
if(NOT fetched EQUAL 0)
  message(FATAL_ERROR "Plotly, which draws the report's charts, could not be fetched (see above).")
endif()
