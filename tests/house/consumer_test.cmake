# SPDX-License-Identifier: Apache-2.0
# Installs the build into an empty folder, builds examples/consumer and
# examples/own_task against it and nothing else of ours, and runs them.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with ${result}:\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

set(prefix ${WORK}/prefix)
file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix} --config ${CONFIG})
run(${CMAKE_COMMAND} -S ${SOURCE}/examples/consumer -B ${WORK}/build -G ${GENERATOR}
  -D CMAKE_PREFIX_PATH=${prefix} -D CMAKE_CXX_COMPILER=${CXX} -D CMAKE_BUILD_TYPE=${CONFIG})
file(STRINGS ${WORK}/build/CMakeCache.txt found REGEX "^tangere_DIR:")
string(FIND "${found}" "${prefix}/" at)
if(at EQUAL -1)
  message(FATAL_ERROR "the consumer found another tangere than the one just installed: ${found}")
endif()
run(${CMAKE_COMMAND} --build ${WORK}/build --config ${CONFIG})

set(scene ${prefix}/share/tangere/scenes/rolling_ball.xml)
if(NOT EXISTS ${scene})
  message(FATAL_ERROR "${scene} was not installed")
endif()
run(${WORK}/build/consumer ${scene})
message(STATUS "${output}")
if(NOT output MATCHES "peak normal tactile force: [0-9.e+-]+ N")
  message(FATAL_ERROR "the consumer printed something else:\n${output}")
endif()
run(${prefix}/bin/tangere --help)
# A scene elsewhere includes a layout that was installed.
file(WRITE ${WORK}/elsewhere.xml "<tangere><option unit=\"m-kg\"/><robot><link name=\"a\"><joint name=\"a\" "
  "type=\"free2d\"/><body name=\"a\" type=\"sphere\" radius=\"0.01\"/></link></robot>"
  "<sensor><include file=\"sensors/digit_guess.xml\" body=\"a\"/></sensor></tangere>")
run(${prefix}/bin/tangere inspect ${WORK}/elsewhere.xml)

# The command with a task of another program.
run(${CMAKE_COMMAND} -S ${SOURCE}/examples/own_task -B ${WORK}/own_task -G ${GENERATOR}
  -D CMAKE_PREFIX_PATH=${prefix} -D CMAKE_CXX_COMPILER=${CXX} -D CMAKE_BUILD_TYPE=${CONFIG})
run(${CMAKE_COMMAND} --build ${WORK}/own_task --config ${CONFIG})
set(own ${WORK}/own_task/own_task)
run(${own} inspect press)
run(${own} generate press -o ${WORK}/presses --episodes 16)
run(${own} validate ${WORK}/presses)
run(${own} simulate press -o ${WORK}/press.h5 --envs 2)
run(${own} bench press --envs 16 --threads 1 --repeat 1)
execute_process(COMMAND ${own} gradcheck press RESULT_VARIABLE result ERROR_VARIABLE output OUTPUT_QUIET)
if(result EQUAL 0 OR NOT output MATCHES "task press has no derivative")
  message(FATAL_ERROR "gradcheck of a task without derivatives ended with ${result}:\n${output}")
endif()
