# Writes OUTPUT, which ctest includes: an entry NAME.Suite for every suite that the GoogleTest binary EXECUTABLE
# lists, with label LABEL and TIMEOUT in seconds. Run with cmake -P after the binary is linked.
execute_process(COMMAND "${EXECUTABLE}" --gtest_list_tests
  OUTPUT_VARIABLE listed ERROR_VARIABLE errors RESULT_VARIABLE status TIMEOUT 120)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "${EXECUTABLE} --gtest_list_tests: got ${status}, expected 0\n${listed}${errors}")
endif()

# A suite's line starts at the margin and ends in a dot, or in a dot and a comment about its type parameter; the
# lines of its cases are indented.
string(REPLACE ";" "\\;" lines "${listed}")
string(REPLACE "\n" ";" lines "${lines}")
set(entries "")
foreach(line IN LISTS lines)
  if(line MATCHES "^([^ ]+)\\.( +#.*)?$")
    set(suite "${CMAKE_MATCH_1}")
    string(APPEND entries "add_test([=[${NAME}.${suite}]=] [=[${EXECUTABLE}]=] [=[--gtest_filter=${suite}.*]=])\n"
                          "set_tests_properties([=[${NAME}.${suite}]=] PROPERTIES"
                          " LABELS ${LABEL} TIMEOUT ${TIMEOUT})\n")
  endif()
endforeach()
if(entries STREQUAL "")
  message(FATAL_ERROR "${EXECUTABLE} --gtest_list_tests: no suite found in\n${listed}")
endif()
file(WRITE "${OUTPUT}" "${entries}")
