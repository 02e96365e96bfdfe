# SPDX-License-Identifier: Apache-2.0
# Flags of every target of ours, and the reason beside each.
add_library(tangere_flags INTERFACE)
target_compile_features(tangere_flags INTERFACE cxx_std_20)
target_compile_options(tangere_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion
  -Wno-sign-conversion   # indices are int in loops over dofs and std::size_t in containers
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>  # GCC 12 sees an overlap in "text" + std::string() where there is none
  -ffp-contract=off      # a product and a sum are fused where the source says mul_add, nowhere else: same bits everywhere
  -fno-math-errno        # sqrt is one instruction
  -fno-trapping-math)    # branches on numbers may become selects; nobody reads the exception flags
target_include_directories(tangere_flags INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)

# Behind a precompiled header GCC 12 finds overruns in "text" + std::string() where there are none.
set(precompiled_warnings
  "$<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds;-Wno-stringop-overflow;-Wno-stringop-overread>")

# Who builds once (./run-demo, ./run-tests) compiles eight sources as one, in half the time. Who edits (./dev) does not, so
# that a change recompiles one source, and that a source which lacks an include is found.
set(CMAKE_UNITY_BUILD_BATCH_SIZE 8)
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # A class that only its own source sees may have members from that source's anonymous namespace.
  target_compile_options(tangere_flags INTERFACE -Wno-subobject-linkage)
endif()

# A warning is an error with the compiler the project is developed with. What another compiler, or the next release of
# this one, warns about must not stop somebody who only wants to build the program.
if(NOT DEFINED CMAKE_COMPILE_WARNING_AS_ERROR AND PROJECT_IS_TOP_LEVEL
   AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  set(CMAKE_COMPILE_WARNING_AS_ERROR ON)
endif()

if(TANGERE_SANITIZE)
  # vptr gives false reports from TBB's flow graph.
  target_compile_options(tangere_flags INTERFACE
    -fsanitize=${TANGERE_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all -fno-sanitize=vptr)
  target_link_options(tangere_flags INTERFACE -fsanitize=${TANGERE_SANITIZE})
endif()
