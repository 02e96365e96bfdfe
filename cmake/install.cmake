# SPDX-License-Identifier: Apache-2.0
# The install tree: `cmake --install build/release --prefix DIR`, then find_package(tangere CONFIG) from another
# project.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/tangere)

add_library(tangere_umbrella INTERFACE)
add_library(tangere::tangere ALIAS tangere_umbrella)
target_link_libraries(tangere_umbrella INTERFACE tangere::tasks tangere::io)
set_target_properties(tangere_umbrella PROPERTIES EXPORT_NAME tangere)

foreach(library kernels engine tasks io command)
  target_include_directories(tangere_${library} INTERFACE
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(tangere_${library} INTERFACE cxx_std_20)
endforeach()
# These also become part of shared objects, such as the Python module.
set_target_properties(tangere_kernels tangere_engine tangere_tasks tangere_io PROPERTIES POSITION_INDEPENDENT_CODE ON)
set_target_properties(tangere_flags PROPERTIES EXPORT_NAME flags)  # passes a sanitizer on to users of the libraries

install(TARGETS tangere_kernels tangere_engine tangere_tasks tangere_io tangere_command tangere_umbrella tangere_flags
  EXPORT tangere ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(TARGETS tangere RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
# Installs apps/tangere.hpp and what it includes, with names that begin with tangere/.
install(CODE "set(source [[${PROJECT_SOURCE_DIR}]])\nset(destination [[${CMAKE_INSTALL_INCLUDEDIR}/tangere]])")
install(SCRIPT cmake/install_headers.cmake)
install(DIRECTORY scenes/ DESTINATION ${CMAKE_INSTALL_DATADIR}/tangere/scenes)
install(FILES LICENSE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})

install(EXPORT tangere NAMESPACE tangere:: FILE tangere-targets.cmake DESTINATION ${package})
configure_package_config_file(cmake/tangere-config.cmake.in ${PROJECT_BINARY_DIR}/tangere-config.cmake
  INSTALL_DESTINATION ${package} PATH_VARS CMAKE_INSTALL_DATADIR)
# 0.x: a minor release may change the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/tangere-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/tangere-config.cmake ${PROJECT_BINARY_DIR}/tangere-config-version.cmake
  DESTINATION ${package})
