# SPDX-License-Identifier: Apache-2.0
# Everything comes from the distribution's packages; ./run-demo installs what is missing.
find_package(Threads REQUIRED)
find_package(TBB CONFIG REQUIRED)
find_package(Eigen3 CONFIG REQUIRED)
find_package(xsimd CONFIG REQUIRED)
# Debian's xsimd 8 asks to link xtl, a library of headers that neither it nor we include.
if(NOT TARGET xtl)
  set_property(TARGET xsimd PROPERTY INTERFACE_LINK_LIBRARIES "")
endif()
find_package(HDF5 REQUIRED COMPONENTS C)
# Debian 12's libdeflate comes without files for CMake; io links it by its plain name.
find_path(LIBDEFLATE_INCLUDE_DIR libdeflate.h REQUIRED)
find_library(LIBDEFLATE_LIBRARY deflate REQUIRED)
find_package(tinyxml2 CONFIG REQUIRED)
find_package(CLI11 CONFIG REQUIRED)
find_package(fmt CONFIG REQUIRED)
find_package(nlohmann_json CONFIG REQUIRED)
if(TANGERE_TESTS)
  find_package(GTest CONFIG REQUIRED)
endif()
if(TANGERE_BENCH)
  find_package(benchmark CONFIG REQUIRED)
endif()
