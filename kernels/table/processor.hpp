// SPDX-License-Identifier: Apache-2.0
// Which instruction sets the processor runs. Tests of lanes use it without linking the kernels.
#pragma once

#include <string_view>

namespace tangere::kernels {

/// Whether the processor and the operating system run an instruction set: "avx512", "avx2", "sse2"
/// or "scalar". The compiler's own detection decides.
inline bool processor_runs([[maybe_unused]] std::string_view isa) {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (isa == "avx512")
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
  if (isa == "avx2") return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#endif
  return true;
}

}  // namespace tangere::kernels
