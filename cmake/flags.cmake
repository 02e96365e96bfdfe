# SPDX-License-Identifier: Apache-2.0
# Flags of every target of ours, and the reason beside each.
add_library(tangere_flags INTERFACE)
target_compile_features(tangere_flags INTERFACE cxx_std_20)
target_compile_options(tangere_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion -Werror
  -ffp-contract=off      # a product and a sum are fused where the source says mul_add, nowhere else: same bits everywhere
  -fno-math-errno        # sqrt is one instruction
  -fno-trapping-math)
if(TANGERE_SANITIZE)
  # vptr gives false reports from TBB's flow graph.
  target_compile_options(tangere_flags INTERFACE -fsanitize=${TANGERE_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all -fno-sanitize=vptr)
  target_link_options(tangere_flags INTERFACE -fsanitize=${TANGERE_SANITIZE})
endif()
target_include_directories(tangere_flags INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
