# q3d_end_to_end(NAME): the end-to-end script NAME.py of this folder, one ctest entry a test.
#
# Python's unittest lists the script's tests when CMake configures; the program need not exist then. Test `test` of
# class `Case` becomes the entry NAME.Case.test. The tests of a class share a folder, which the entry
# NAME.Case.prepare fills and NAME.Case.remove deletes; ctest adds both by itself to any test that needs them.
function(q3d_end_to_end name)
  set(script "${CMAKE_CURRENT_SOURCE_DIR}/${name}.py")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${script}")
  execute_process(COMMAND ${Q3D_PYTHON} ${Q3D_E2E} list ${script} OUTPUT_VARIABLE tests
                  OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  string(REPLACE "\n" ";" tests "${tests}")
  set(cases "")
  foreach(test IN LISTS tests)
    string(REGEX REPLACE "\\..*" "" case "${test}")
    if(NOT case IN_LIST cases)
      list(APPEND cases ${case})
      q3d_end_to_end_case(${name} ${script} ${case})
    endif()
    q3d_end_to_end_entry(${name}.${test} ${name}.${case} run ${script} ${test})
    set_tests_properties(${name}.${test} PROPERTIES FIXTURES_REQUIRED ${name}.${case})
  endforeach()
endfunction()

# The entries that make and remove the folder of a class.
function(q3d_end_to_end_case name script case)
  set(fixture ${name}.${case})
  q3d_end_to_end_entry(${fixture}.prepare ${fixture} prepare ${script} ${case})
  set_tests_properties(${fixture}.prepare PROPERTIES FIXTURES_SETUP ${fixture})
  add_test(NAME ${fixture}.remove COMMAND ${CMAKE_COMMAND} -E rm -rf "${CMAKE_CURRENT_BINARY_DIR}/${fixture}")
  set_tests_properties(${fixture}.remove PROPERTIES FIXTURES_CLEANUP ${fixture} LABELS e2e)
endfunction()

# One entry that runs tests/support/e2e with the folder of a class.
# The limit only ends a program that hangs: on a busy machine an entry of a few seconds can take many minutes.
function(q3d_end_to_end_entry entry fixture)
  add_test(NAME ${entry}
    COMMAND ${Q3D_PYTHON} ${Q3D_E2E} --program $<TARGET_FILE:quadruped3d> --faults $<TARGET_FILE:q3d_faults>
            --folder "${CMAKE_CURRENT_BINARY_DIR}/${fixture}" ${ARGN})
  set_tests_properties(${entry} PROPERTIES LABELS e2e TIMEOUT 3600)
endfunction()
