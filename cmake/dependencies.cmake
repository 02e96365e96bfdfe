# SPDX-License-Identifier: Apache-2.0
# Everything comes from the distribution's packages; ./run-demo installs what is missing.
find_package(Threads REQUIRED)
find_package(TBB CONFIG REQUIRED)
find_package(Eigen3 CONFIG REQUIRED)
find_package(xsimd CONFIG REQUIRED)
# Debian's xsimd 8 links xtl, a header-only library that neither it nor we include.
if(NOT TARGET xtl)
  set_property(TARGET xsimd PROPERTY INTERFACE_LINK_LIBRARIES "")
endif()
find_package(HDF5 REQUIRED COMPONENTS C)
# The archive of HDF5 becomes part of the Python module (python/CMakeLists.txt) once its names for the standard streams
# are our own.
if(HDF5_USE_STATIC_LIBRARIES)
  set(hdf5_archive ${PROJECT_BINARY_DIR}/libhdf5.a)
  execute_process(COMMAND ${CMAKE_OBJCOPY} --redefine-sym stdin=tangere_stdin --redefine-sym stdout=tangere_stdout
    --redefine-sym stderr=tangere_stderr ${HDF5_C_LIBRARY_hdf5} ${hdf5_archive} COMMAND_ERROR_IS_FATAL ANY)
  add_library(tangere_hdf5_streams STATIC cmake/hdf5_streams.cpp)
  set_target_properties(tangere_hdf5_streams PROPERTIES POSITION_INDEPENDENT_CODE ON)
  set_target_properties(hdf5::hdf5 PROPERTIES IMPORTED_LOCATION ${hdf5_archive}
    INTERFACE_LINK_LIBRARIES "${hdf5_archive};tangere_hdf5_streams;sz;z;${CMAKE_DL_LIBS}")
endif()
# Debian 12's libdeflate and liblz4 have no CMake files, so io links them by their plain names.
find_path(LIBDEFLATE_INCLUDE_DIR libdeflate.h REQUIRED)
find_library(LIBDEFLATE_LIBRARY deflate REQUIRED)
find_path(LIBLZ4_INCLUDE_DIR lz4.h REQUIRED)
find_library(LIBLZ4_LIBRARY lz4 REQUIRED)
find_package(PNG REQUIRED)
find_package(JPEG REQUIRED)
# xxHash is used as a header alone.
find_path(XXHASH_INCLUDE_DIR xxhash.h REQUIRED)
add_library(tangere_xxhash INTERFACE)
target_include_directories(tangere_xxhash SYSTEM INTERFACE ${XXHASH_INCLUDE_DIR})
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
