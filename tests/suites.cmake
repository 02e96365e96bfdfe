# SPDX-License-Identifier: Apache-2.0
# The suites that take seconds, longest first. They have the label slow. A fresh ctest starts them first, so that all
# cores end together; afterwards it goes by the times that it has measured.
set(long golden_test.GoldenScenes engine_test.All/AdjointScheme tasks_test.Scenes/EveryScene
  apps_fault_test.Calls/Fault tasks_test.Scripted engine_test.All/Landing engine_test.Schemes/ShearGradient
  engine_test.MeshGrid engine_test.MeshContact engine_test.Laws/ContactJacobian apps_test.Stress
  apps_test.InspectEffects tasks_test.PublishedFaults tasks_test.Identification tasks_test.Tasks/EveryLoop
  tasks_test.Tasks/EveryTape apps_test.View apps_test.Command apps_threads_test.GenerateGradients
  apps_threads_test.Tasks apps_memory_test.DatasetCommand io_memory_test.ChunkCodec apps_threads_test.GenerateShards
  tasks_memory_threads_test.Tasks/EveryTask tasks_memory_threads_test.BenchmarkRun apps_threads_test.GeneratePolicy
  apps_memory_test.DamagedFile apps_memory_test.Files/DamagedShard apps_threads_test.GenerateCompress
  fuzz_test.Files/Fuzz apps_test.Accuracy apps_test.GenerateStop engine_test.All/Touching
  tasks_threads_test.Tasks/TaskReturn tasks_test.Scenes/VaryingNumbers engine_test.Schemes/FollowersBySchemes
  engine_test.Schemes/DryFriction tasks_test.Pictures engine_test.PegInHole engine_test.Gripper
  tasks_memory_threads_test.AccuracySweep tasks_memory_threads_test.TaskEpisodes apps_memory_test.Import
  apps_memory_threads_test.Record)
list(LENGTH long count)

# Writes OUTPUT, one ctest test NAME.Suite for each suite of the GoogleTest program PROGRAM; run whenever that was
# linked.
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
  set(cost "")
  set(labels ${LABELS})
  list(FIND long ${NAME}.${suite} place)
  if(place GREATER -1)
    math(EXPR cost "${count} - ${place}")
    set(cost " COST ${cost}")
    list(APPEND labels slow)
  endif()
  string(APPEND text "add_test([=[${NAME}.${suite}]=] [=[${PROGRAM}]=] [=[--gtest_filter=${suite}.*${LEFT_OUT}]=])
set_tests_properties([=[${NAME}.${suite}]=] PROPERTIES TIMEOUT 1800
  LABELS [=[${labels}]=] ENVIRONMENT [=[${ENVIRONMENT}]=]${cost})
")
endforeach()
file(WRITE ${OUTPUT} "${text}")
