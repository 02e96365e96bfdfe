# SPDX-License-Identifier: Apache-2.0
# The flags of all our targets, each with its reason.
add_library(tangere_flags INTERFACE)
target_compile_features(tangere_flags INTERFACE cxx_std_20)
target_compile_options(tangere_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion
  -Wno-sign-conversion   # indices are int in loops over dofs and std::size_t in containers
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>  # GCC 12 sees an overlap in "text" + std::string() where there is none
  $<$<CXX_COMPILER_ID:GNU>:-fno-semantic-interposition>  # the libraries are -fPIC and inline as other code does
  # A product and a sum are fused where the source says mul_add, nowhere else: same bits everywhere.
  -ffp-contract=off
  # Not -O0: after fmt's pragmas in a precompiled header GCC 12 keeps __OPTIMIZE__ defined, and Eigen does not compile.
  $<$<CONFIG:Debug>:-Og>
  -fno-math-errno        # sqrt is one instruction
  -fno-trapping-math)    # branches on numbers may become selects; nobody reads the exception flags
target_include_directories(tangere_flags INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)

# Behind a precompiled header GCC 12 finds overruns in "text" + std::string() where there are none.
set(precompiled_warnings
  "$<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds;-Wno-stringop-overflow;-Wno-stringop-overread>")

# ./run-demo and ./run-tests build once and compile 24 sources as one, which parses their headers once. ./dev
# does not: a change then recompiles one source, and a missing include is found.
set(CMAKE_UNITY_BUILD_BATCH_SIZE 24)
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # A class that only one source uses may have members from that source's anonymous namespace.
  target_compile_options(tangere_flags INTERFACE -Wno-subobject-linkage)
endif()

# With the compiler that the project is developed with, warnings are errors. Warnings of other
# compilers, or of its next release, must not stop people who only want to build the program.
if(NOT DEFINED CMAKE_COMPILE_WARNING_AS_ERROR AND PROJECT_IS_TOP_LEVEL
   AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  set(CMAKE_COMPILE_WARNING_AS_ERROR ON)
endif()

if(TANGERE_SANITIZE)
  # vptr gives false reports from TBB's flow graph.
  target_compile_options(tangere_flags INTERFACE
    -fsanitize=${TANGERE_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all -fno-sanitize=vptr)
  target_link_options(tangere_flags INTERFACE -fsanitize=${TANGERE_SANITIZE})
  # Whether an address wraps or points beyond an object: the address sanitizer stops at the access
  # itself. These two checks take a third of the compile time of kernels and a fifth of that of io.
  if(TANGERE_SANITIZE MATCHES "undefined" AND TANGERE_SANITIZE MATCHES "address")
    target_compile_options(tangere_flags INTERFACE -fno-sanitize=pointer-overflow,object-size)
  endif()
  # Every access of a pointer or a reference is also checked for null and for alignment where TANGERE_CASTS is set: in
  # the kernels, which read numbers as lanes by casts. Elsewhere casts go to bytes, which have no alignment, and the
  # address sanitizer stops at a null pointer, so the checks would only cost compile time: a sixth of it in io.
  if(TANGERE_SANITIZE MATCHES "undefined" AND TANGERE_SANITIZE MATCHES "address")
    target_compile_options(tangere_flags INTERFACE
      $<$<NOT:$<BOOL:$<TARGET_PROPERTY:TANGERE_CASTS>>>:-fno-sanitize=null,alignment>)
  endif()
endif()
