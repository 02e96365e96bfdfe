# SPDX-License-Identifier: Apache-2.0
# The install tree: `cmake --install build/release --prefix DIR`, then find_package(tangere CONFIG) from another
# project.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# Headers keep their names, such as "engine/model/model.hpp", because they include each other by
# them. So the folder on users' include path is include/tangere.
set(headers ${CMAKE_INSTALL_INCLUDEDIR}/tangere)
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/tangere)

add_library(tangere_umbrella INTERFACE)
add_library(tangere::tangere ALIAS tangere_umbrella)
target_link_libraries(tangere_umbrella INTERFACE tangere::tasks tangere::io)
set_target_properties(tangere_umbrella PROPERTIES EXPORT_NAME tangere)

foreach(library kernels engine tasks io command)
  target_include_directories(tangere_${library} INTERFACE
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${headers}>)
  target_compile_features(tangere_${library} INTERFACE cxx_std_20)
endforeach()
# These also become part of shared objects, such as the Python module.
set_target_properties(tangere_kernels tangere_engine tangere_tasks tangere_io PROPERTIES POSITION_INDEPENDENT_CODE ON)
set_target_properties(tangere_flags PROPERTIES EXPORT_NAME flags)  # passes a sanitizer on to users of the libraries

install(TARGETS tangere_kernels tangere_engine tangere_tasks tangere_io tangere_command tangere_umbrella tangere_flags
  EXPORT tangere ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(TARGETS tangere RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
set(public_headers
  apps/program.hpp
  engine/base/aligned.hpp
  engine/base/as_size.hpp
  engine/base/checks.hpp
  engine/base/error.hpp
  engine/base/precision.hpp
  engine/base/vector3.hpp
  engine/derivative/adjoint.hpp
  engine/derivative/block_cotangent.hpp
  engine/derivative/field_tangent.hpp
  engine/derivative/loss.hpp
  engine/derivative/number_gradients.hpp
  engine/derivative/tactile_point_numbers.hpp
  engine/derivative/readout_pullback.hpp
  engine/derivative/step_jacobian.hpp
  engine/derivative/tangent.hpp
  engine/scene/contact_resolution.hpp
  engine/scene/effect_kind.hpp
  engine/scene/effects.hpp
  engine/scene/sensed_bodies.hpp
  engine/scene/field_form.hpp
  engine/scene/imperfection_checks.hpp
  engine/model/model.hpp
  engine/model/model_info.hpp
  engine/scene/number_address.hpp
  engine/scene/outer_pose.hpp
  engine/scene/output_times.hpp
  engine/scene/pose.hpp
  engine/model/random.hpp
  engine/scene/scene.hpp
  engine/scene/scene_faults.hpp
  engine/scene/scene_number.hpp
  engine/scene/schema.hpp
  engine/scene/scheme.hpp
  engine/scene/sensor_imperfections.hpp
  engine/scene/shapes.hpp
  engine/scene/units.hpp
  engine/model/short_touches.hpp
  engine/rows/episode_sink.hpp
  engine/rows/row_sink.hpp
  engine/rows/task_spec.hpp
  engine/sense/energy_balance.hpp
  engine/sense/contact_state.hpp
  engine/sense/flow_map.hpp
  engine/sense/marker_map.hpp
  engine/sense/readout.hpp
  engine/sense/start_overlaps.hpp
  engine/sense/tactile_frame.hpp
  engine/step/batch.hpp
  engine/step/control.hpp
  engine/step/displacement.hpp
  engine/step/shear_state_arrays.hpp
  engine/step/sleeping_trees.hpp
  engine/step/shear_state.hpp
  engine/step/sleep_state.hpp
  engine/step/stepper.hpp
  engine/step/stepper_options.hpp
  engine/step/tape.hpp
  io/dataset/dataset_export.hpp
  io/dataset/dataset_files.hpp
  io/dataset/dataset_from_model.hpp
  io/dataset/dataset_layout.hpp
  io/dataset/dataset_merge.hpp
  io/dataset/dataset_writer.hpp
  io/dataset/shard_check.hpp
  io/robot/robot_import.hpp
  io/scene/scene_reader.hpp
  io/trajectory/layout_from_model.hpp
  io/trajectory/run_facts.hpp
  io/trajectory/trajectory_file.hpp
  io/trajectory/trajectory_layout.hpp
  kernels/contact/contact_types.hpp
  kernels/numbers/block.hpp
  kernels/table/isa.hpp
  tasks/catalogue/task.hpp
  tasks/catalogue/task_list.hpp
  tasks/effects/ablation.hpp
  tasks/gradients/field_sequence.hpp
  tasks/gradients/gradients.hpp
  tasks/gradients/identification.hpp
  tasks/gradients/losses.hpp
  tasks/gradients/residual_test.hpp
  tasks/gradients/tape_options.hpp
  tasks/gradients/task_rollout.hpp
  tasks/gradients/task_tape.hpp
  tasks/gradients/gradient_check.hpp
  tasks/run/energy_balance_summary.hpp
  tasks/run/benchmark_options.hpp
  tasks/run/benchmark_run.hpp
  tasks/run/block_worker.hpp
  tasks/run/episode_program.hpp
  tasks/run/episode_options.hpp
  tasks/run/episodes.hpp
  tasks/run/policy.hpp
  tasks/run/progress.hpp
  tasks/run/rollout.hpp
  tasks/run/step_counts.hpp
  tasks/run/step_tally.hpp
  tasks/run/vector_task.hpp)
foreach(header ${public_headers})
  cmake_path(GET header PARENT_PATH folder)
  install(FILES ${header} DESTINATION ${headers}/${folder})
endforeach()
install(DIRECTORY scenes/ DESTINATION ${CMAKE_INSTALL_DATADIR}/tangere/scenes)
install(FILES LICENSE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})

install(EXPORT tangere NAMESPACE tangere:: FILE tangere-targets.cmake DESTINATION ${package})
configure_package_config_file(cmake/tangere-config.cmake.in ${PROJECT_BINARY_DIR}/tangere-config.cmake
  INSTALL_DESTINATION ${package} PATH_VARS CMAKE_INSTALL_DATADIR)
# 0.x: a minor release may change the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/tangere-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/tangere-config.cmake ${PROJECT_BINARY_DIR}/tangere-config-version.cmake
  DESTINATION ${package})
