# SPDX-License-Identifier: Apache-2.0
# Writes OUTPUT, one ctest test NAME.Suite for each suite of the GoogleTest program PROGRAM; run whenever that was linked.
execute_process(COMMAND ${PROGRAM} --gtest_list_tests --gtest_filter=*${LEFT_OUT}
  OUTPUT_VARIABLE listing RESULT_VARIABLE status TIMEOUT 60)
if(NOT status EQUAL 0)
  message(FATAL_ERROR "${PROGRAM} --gtest_list_tests: ${status}")
endif()
string(REGEX MATCHALL "(^|\n)[A-Za-z0-9_/]+\\." suites "${listing}")
set(text "")
foreach(suite ${suites})
  string(STRIP "${suite}" suite)
  string(REGEX REPLACE "\\.$" "" suite "${suite}")
  string(APPEND text "add_test([=[${NAME}.${suite}]=] [=[${PROGRAM}]=] [=[--gtest_filter=${suite}.*${LEFT_OUT}]=])
set_tests_properties([=[${NAME}.${suite}]=] PROPERTIES TIMEOUT 1800 LABELS [=[${LABELS}]=] ENVIRONMENT [=[${ENVIRONMENT}]=])
")
endforeach()
file(WRITE ${OUTPUT} "${text}")
