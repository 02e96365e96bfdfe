# SPDX-License-Identifier: Apache-2.0
# The install tree: `cmake --install build/release --prefix DIR`, then find_package(tangere CONFIG) from another project.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# Headers keep the names they have here, "engine/model.hpp", because they include each other by them. So the folder that
# users get on their include path is include/tangere.
set(headers ${CMAKE_INSTALL_INCLUDEDIR}/tangere)
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/tangere)

add_library(tangere_umbrella INTERFACE)
add_library(tangere::tangere ALIAS tangere_umbrella)
target_link_libraries(tangere_umbrella INTERFACE tangere::tasks tangere::io)
set_target_properties(tangere_umbrella PROPERTIES EXPORT_NAME tangere)

foreach(library kernels engine tasks io)
  target_include_directories(tangere_${library} INTERFACE
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${headers}>)
  target_compile_features(tangere_${library} INTERFACE cxx_std_20)
endforeach()
set_target_properties(tangere_flags PROPERTIES EXPORT_NAME flags)  # carries a sanitizer to whoever links the libraries

install(TARGETS tangere_kernels tangere_engine tangere_tasks tangere_io tangere_umbrella tangere_flags
  EXPORT tangere ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(TARGETS tangere RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(FILES kernels/contact_types.hpp DESTINATION ${headers}/kernels)
install(FILES engine/adjoint.hpp engine/aligned.hpp engine/batch.hpp engine/control.hpp engine/episode_sink.hpp engine/error.hpp
  engine/field_tangent.hpp engine/flow_map.hpp engine/loss.hpp engine/model.hpp engine/parameters.hpp engine/point_numbers.hpp engine/readout_pullback.hpp
  engine/step_jacobian.hpp engine/tape.hpp
  engine/precision.hpp engine/readout.hpp engine/row_sink.hpp engine/scene.hpp engine/stepper.hpp
  engine/tactile_frame.hpp engine/task_spec.hpp DESTINATION ${headers}/engine)
install(FILES tasks/benchmark_run.hpp tasks/episodes.hpp tasks/gradients.hpp tasks/identification.hpp tasks/losses.hpp tasks/policy.hpp tasks/rollout.hpp tasks/task.hpp
  tasks/task_episodes.hpp tasks/task_list.hpp tasks/task_pilot.hpp tasks/vector_task.hpp DESTINATION ${headers}/tasks)
install(FILES io/dataset_export.hpp io/dataset_files.hpp io/dataset_layout.hpp io/dataset_merge.hpp io/dataset_writer.hpp
  io/scene_reader.hpp io/shard_check.hpp io/trajectory_file.hpp
  io/trajectory_layout.hpp DESTINATION ${headers}/io)
install(DIRECTORY scenes/ DESTINATION ${CMAKE_INSTALL_DATADIR}/tangere/scenes)
install(FILES LICENSE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})

install(EXPORT tangere NAMESPACE tangere:: FILE tangere-targets.cmake DESTINATION ${package})
configure_package_config_file(cmake/tangere-config.cmake.in ${PROJECT_BINARY_DIR}/tangere-config.cmake
  INSTALL_DESTINATION ${package} PATH_VARS CMAKE_INSTALL_DATADIR)
# 0.x: a minor release may change the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/tangere-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/tangere-config.cmake ${PROJECT_BINARY_DIR}/tangere-config-version.cmake
  DESTINATION ${package})
